// Reads a tileset with loaders.gl over HTTP and asks Khronos's glTF validator about each of its contents.
// Usage: node check_tiles.mjs FOLDER; prints what it found as JSON.
import {readFile} from 'node:fs/promises';
import {createServer} from 'node:http';
import path from 'node:path';
import {load, parse} from '@loaders.gl/core';
import {Tiles3DLoader} from '@loaders.gl/3d-tiles';
import {GLTFLoader} from '@loaders.gl/gltf';
import validator from 'gltf-validator';

const folder = path.resolve(process.argv[2]);
const server = createServer(async (request, response) => {
  try {
    response.end(await readFile(path.join(folder, path.normalize(decodeURIComponent(request.url)))));
  } catch {
    response.writeHead(404).end();
  }
});
await new Promise((ready) => server.listen(0, '127.0.0.1', ready));
const base = `http://127.0.0.1:${server.address().port}/`;

const tileset = await load(base + 'tileset.json', Tiles3DLoader, {'3d-tiles': {isTileset: true, loadGLTF: false}});
const found = {tiles: 0, contents: [], vertices: 0, triangles: 0, textures: 0, errors: [], warnings: []};
const walk = (tile) => {
  found.tiles += 1;
  if (tile.contentUrl) found.contents.push(tile.contentUrl.slice(base.length));
  for (const child of tile.children ?? []) walk(child);
};
walk(tileset.root);

for (const name of found.contents) {
  const bytes = await readFile(path.join(folder, name));
  const report = await validator.validateBytes(new Uint8Array(bytes), {uri: name});
  for (const message of report.issues.messages) {
    const line = `${name}: ${message.code} at ${message.pointer}`;
    if (message.severity === 0) found.errors.push(line);
    if (message.severity === 1) found.warnings.push(line);
  }
  const {buffer, byteOffset, byteLength} = bytes;
  const gltf = await parse(buffer.slice(byteOffset, byteOffset + byteLength), GLTFLoader,
                           {gltf: {loadImages: false, decompressMeshes: true}});
  found.textures += gltf.json.images?.length ?? 0;
  for (const primitive of gltf.json.meshes.flatMap((mesh) => mesh.primitives)) {
    found.vertices += gltf.json.accessors[primitive.attributes.POSITION].count;
    found.triangles += gltf.json.accessors[primitive.indices].count / 3;
  }
}
server.close();
console.log(JSON.stringify(found));
