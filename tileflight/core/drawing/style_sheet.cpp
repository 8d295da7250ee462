#include <array>
#include <string_view>
#include <utility>

#include "tileflight/core/drawing/html.h"

namespace tileflight::drawing {
namespace {

/// Style of charts and views from above, on the page and in files.
constexpr std::string_view kDrawing = R"css(
svg text { font-size: 13px; fill: var(--ink); stroke: none; }
svg .axis { stroke: var(--quiet); }
svg .grid { stroke: var(--grid); }
svg .frame { fill: var(--panel); stroke: var(--rule); }
svg .halo { paint-order: stroke; stroke: var(--paper); stroke-width: 4px; stroke-linejoin: round; font-weight: 600; }
svg .scale-bar { stroke: var(--ink); stroke-width: 4; }
svg .layer { image-rendering: auto; }
svg .backdrop { opacity: .3; }
.line { fill: none; stroke-width: 2; stroke-linejoin: round; }
.area { opacity: .18; stroke: none; }
.mark { stroke-width: 1.6; stroke-dasharray: 6 4; }
.line.simulated, .mark.simulated { stroke: var(--simulated); }
.line.real, .mark.real { stroke: var(--real); }
.line.overlap { stroke: var(--ink); }
.line.correlation { stroke: var(--truth); }
.line.structure { stroke: var(--floor); stroke-dasharray: 6 3; }
.area.simulated { fill: var(--simulated); }
.area.real { fill: var(--real); }
.mark.floor { stroke: var(--floor); stroke-dasharray: 2 3; stroke-width: 2; }
.true-path { stroke-dasharray: 7 4; stroke-width: 1.6; opacity: .8; }
.estimate { stroke-width: 2.2; }
.dots { fill: none; stroke-width: 4; stroke-linecap: round; opacity: .45; }
.dots.simulated, .dots-sample.simulated { stroke: var(--simulated); }
.dots.real, .dots-sample.real { stroke: var(--real); }
.dots-sample { stroke-width: 4; stroke-linecap: round; stroke-dasharray: 0 8; opacity: .6; }
.line.reference { stroke: var(--ink); stroke-dasharray: 7 4; stroke-width: 1.6; }
.start.reference { stroke: var(--ink); }
.line.series-1, .start.series-1 { stroke: #2f6fde; }
.line.series-2, .start.series-2 { stroke: #d83b33; }
.line.series-3, .start.series-3 { stroke: #2f9e5c; }
.line.series-4, .start.series-4 { stroke: #b9770e; }
.line.series-5, .start.series-5 { stroke: #8f5fd6; }
.line.series-6, .start.series-6 { stroke: #0d97a3; }
.line.series-7, .start.series-7 { stroke: #cc4a86; }
.line.series-8, .start.series-8 { stroke: #7c858f; }
.line.later-round { stroke-dasharray: 3 3; }
.start { fill: var(--paper); stroke-width: 2; }
.start.simulated { stroke: var(--simulated); }
.start.real { stroke: var(--real); }
)css";

/// Values of the page's light colours, for programs that do not support CSS variables.
constexpr std::array<std::pair<std::string_view, std::string_view>, 10> kLight{{
    {"var(--ink)", "#1c2126"},
    {"var(--quiet)", "#5a6570"},
    {"var(--paper)", "#ffffff"},
    {"var(--panel)", "#f5f7f9"},
    {"var(--rule)", "#d5dbe1"},
    {"var(--grid)", "#e6eaee"},
    {"var(--simulated)", "#2f6fde"},
    {"var(--real)", "#d83b33"},
    {"var(--floor)", "#6b7680"},
    {"var(--truth)", "#2b8a52"},
}};

constexpr std::string_view kPage = R"css(
:root {
  color-scheme: light dark;
  --ink: #1c2126; --quiet: #5a6570; --paper: #ffffff; --panel: #f5f7f9; --rule: #d5dbe1; --grid: #e6eaee;
  --simulated: #2f6fde; --real: #d83b33; --truth: #2b8a52; --floor: #6b7680; --focus: #1a56c4;
}
@media (prefers-color-scheme: dark) {
  :root {
    --ink: #e8ebee; --quiet: #a3adb7; --paper: #14181c; --panel: #1d2328; --rule: #3a434b; --grid: #2a3138;
    --simulated: #6ea0f5; --real: #f2766f; --truth: #63bf87; --floor: #9aa5af; --focus: #8fb6ff;
  }
}
@media (prefers-color-scheme: dark) {
  svg .layer.truth { filter: brightness(.62) saturate(1.2); }
  svg .layer.simulated, svg .layer.real { filter: brightness(1.35); }
}
* { box-sizing: border-box; }
html { font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans", sans-serif; }
body { margin: 0; color: var(--ink); background: var(--paper); }
a { color: var(--focus); }
:focus-visible { outline: 3px solid var(--focus); outline-offset: 2px; }
.skip { position: absolute; left: -999px; }
.skip:focus { left: 1rem; top: 1rem; background: var(--paper); padding: .5rem 1rem; z-index: 1; }
header, main, footer { max-width: 76rem; margin: 0 auto; padding: 0 1.5rem; }
header { padding-top: 2.2rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .2rem; letter-spacing: -.01em; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.6rem 0 .9rem; padding-top: .9rem; border-top: 1px solid var(--rule); }
h3 { font-size: 1rem; margin: 0 0 .4rem; }
.subtitle { color: var(--quiet); margin: 0 0 1rem; overflow-wrap: anywhere; }
.verdict { font-size: 1.15rem; margin: 0 0 1.2rem; padding: .9rem 1.1rem; background: var(--panel); border-left: 4px solid var(--ink); max-width: 62rem; }
.warnings { margin: 0 0 1.2rem; padding: .7rem 1.1rem; border: 2px solid var(--real); max-width: 62rem; font-size: .95rem; }
.warnings h2 { font-size: 1rem; margin: 0; padding: 0; border: 0; }
.warnings ul { margin: .3rem 0 0; padding-left: 1.2rem; }
.warnings .note { color: var(--quiet); }
.notice { margin: 0 0 1.2rem; padding: .7rem 1.1rem; border: 1px dashed var(--quiet); color: var(--quiet); max-width: 62rem; font-size: .92rem; }
.notice ul { margin: .2rem 0 0; padding-left: 1.2rem; }
nav ul { display: flex; flex-wrap: wrap; gap: .3rem 1.2rem; list-style: none; margin: 0; padding: 0; font-size: .92rem; }
.first-screen { display: grid; grid-template-columns: minmax(min-content, 1.25fr) minmax(0, 1fr); gap: 2rem; align-items: start; margin-top: 1.4rem; }
.columns { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 1.6rem 2rem; align-items: start; }
.columns > :only-child { grid-column: 1 / -1; max-width: 42rem; }
figure { margin: 0 0 1.4rem; }
figcaption a { white-space: nowrap; }
.for-readers { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); white-space: nowrap; }
figcaption { color: var(--quiet); font-size: .9rem; margin-top: .5rem; max-width: 46rem; }
.table-frame { overflow-x: auto; margin: 0 0 1.4rem; max-width: 48rem; }
.provenance .table-frame { max-width: none; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .92rem; width: 100%; }
caption { text-align: left; font-weight: 600; padding-bottom: .5rem; }
th, td { padding: .34rem .6rem; text-align: right; border-bottom: 1px solid var(--grid); vertical-align: top; }
th { font-weight: 500; }
tbody th { min-width: 8.5rem; }
tbody th, thead td, th:first-child, td:first-child { text-align: left; padding-left: 0; }
thead th { border-bottom: 2px solid var(--rule); font-weight: 600; }
thead tr:last-child > * { border-bottom: 2px solid var(--rule); }
thead th[scope=colgroup] { border-bottom: 1px solid var(--rule); text-align: center; }
.key-figures { font-size: .9rem; }
.key-figures th, .key-figures td { padding-left: .3rem; padding-right: .3rem; white-space: nowrap; }
.key-figures td.published { color: var(--quiet); }
.key-figures td.simulated { font-weight: 600; color: var(--simulated); }
.key-figures td.real { font-weight: 600; color: var(--real); }
.key-figures tbody.beyond tr:first-child > * { border-top: 2px solid var(--rule); }
.provenance td { text-align: left; overflow-wrap: anywhere; font-family: ui-monospace, "DejaVu Sans Mono", monospace; font-size: .84rem; }
.provenance thead th { text-align: left; }
.provenance tbody th { overflow-wrap: anywhere; min-width: 9rem; }
svg { display: block; width: 100%; height: auto; overflow: visible; }
.legend { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; list-style: none; margin: .4rem 0 0; padding: 0; font-size: .88rem; }
.legend li { display: flex; align-items: center; gap: .45rem; }
.sample { width: 24px; height: 10px; flex: none; }
svg.color-bar { max-width: 340px; margin-top: .6rem; }
.switches { border: 0; margin: 0 0 .5rem; padding: 0; display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; font-size: .92rem; }
.switches legend { float: left; padding: 0; margin-right: 1.2rem; color: var(--quiet); }
.switches label { display: inline-flex; align-items: center; gap: .4rem; cursor: pointer; }
.swatch { width: .8rem; height: .8rem; border-radius: 2px; background: var(--truth); }
.simulated > .swatch { background: var(--simulated); }
.real > .swatch { background: var(--real); }
body:has(#show-truth:not(:checked)) .maps .layer.truth,
body:has(#show-simulated:not(:checked)) .maps .layer.simulated,
body:has(#show-real:not(:checked)) .maps .layer.real { display: none; }
.frames { max-width: 60rem; }
.pair { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: .4rem 1rem; margin-bottom: 1rem; }
.frame img { display: block; width: 100%; height: auto; border-bottom: 3px solid var(--simulated); }
.frame.real img { border-color: var(--real); }
.camera { margin-bottom: 1rem; }
.camera summary { cursor: pointer; margin-bottom: .4rem; }
.frame p, .note { margin: .25rem 0 0; font-size: .88rem; color: var(--quiet); }
.note { grid-column: 1 / -1; }
.note:empty { display: none; }
.provenance pre { overflow-x: auto; padding: .7rem 1rem; background: var(--panel); font-size: .84rem; white-space: pre-wrap; overflow-wrap: anywhere; }
.files { columns: 14rem; font-size: .9rem; padding-left: 1.2rem; }
footer { margin-top: 3rem; padding-top: 1rem; padding-bottom: 2rem; border-top: 1px solid var(--rule); color: var(--quiet); font-size: .88rem; }
)css";

/// Rules that override those of the drawings.
constexpr std::string_view kLast = R"css(
@media (max-width: 52rem) {
  header, main, footer { padding-left: 1rem; padding-right: 1rem; }
  .first-screen, .columns { grid-template-columns: minmax(0, 1fr); }
  svg text { font-size: 15px; }
  th, td { padding: .3rem .45rem; }
  .key-figures { font-size: .78rem; }
  .key-figures tbody th { white-space: normal; }
  tbody th { min-width: 6rem; }
}
@media print {
  :root { --ink: #000; --quiet: #444; --paper: #fff; --panel: #f6f6f6; --rule: #aaa; --grid: #ddd; --simulated: #1f5fcf; --real: #c62f27; --truth: #20733f; --floor: #555; }
  html { font-size: 10.5pt; }
  nav, .skip, .switches, figcaption a, #files { display: none; }
  .columns { grid-template-columns: repeat(2, minmax(0, 1fr)); }
  .first-screen figure { max-width: 13cm; }
  svg text { font-size: 13px; }
  header, main, footer { max-width: none; padding: 0; }
  svg .layer.truth, svg .layer.simulated, svg .layer.real { filter: none; }
  figure, .table-frame, .pair { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
  .table-frame { overflow: visible; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
)css";

}  // namespace

std::string style_sheet() { return std::string(kPage) + std::string(kDrawing) + std::string(kLast); }

std::string drawing_style() {
  std::string style =
      "svg { font-family: \"DejaVu Sans\", Arial, sans-serif; }\n.paper { fill: var(--paper); }\n"
      "svg .title { font-size: 16px; font-weight: bold; }";
  style += kDrawing;
  for (const auto& [name, value] : kLight) {
    for (std::size_t at = style.find(name); at != std::string::npos; at = style.find(name, at))
      style.replace(at, name.size(), value);
  }
  return style;
}

}  // namespace tileflight::drawing
