// Bundles the view into one C++ source: node build.mjs OUTPUT.cpp, in a folder that holds src/ and node_modules/.
import { readFileSync, writeFileSync } from 'node:fs';
import * as esbuild from 'esbuild';

/** Long literals are put together from pieces that any compiler takes. */
function literal(text) {
  const pieces = text.match(/[^]{1,8000}/gu) ?? [''];
  return pieces.map((piece) => `R"tileflight(${piece})tileflight"`).join('\n');
}

const license = readFileSync('node_modules/three/LICENSE', 'utf8').trim();
const built = await esbuild.build({
  entryPoints: ['src/main.ts'],
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2022',
  charset: 'ascii',
  legalComments: 'inline',
  banner: { js: `/*! Holds three.js:\n${license}\n*/` },
  write: false,
});
// The page is well-formed XML too, where the script stands in a CDATA section: `]]>` must not occur. A blank between the
// brackets and the sign means the same in a script and in a shader.
const script = built.outputFiles[0].text.replaceAll(']]>', ']] >');
if (/<\/script|<!--/i.test(script)) throw new Error('the bundle holds what would end a script element');
const style = await esbuild.transform(readFileSync('src/view.css', 'utf8'), { loader: 'css', minify: true, charset: 'ascii' });

writeFileSync(process.argv[2], `#include "tileflight/experiments/report/page_script.h"

namespace tileflight::report {

std::string_view page_script() {
  static constexpr char kScript[] =
${literal(script)};
  return {kScript, sizeof(kScript) - 1};
}

std::string_view view_style() {
  static constexpr char kStyle[] =
${literal(style.code)};
  return {kStyle, sizeof(kStyle) - 1};
}

}  // namespace tileflight::report
`);
