"""A place made by hand: a level square of 80 m, 100 m high, with a box of 4 m in the north, as 3D Tiles 1.1."""
import json
import pathlib
import struct

HALF_M = 40.0
GROUND_M = 100.0
BOX_NORTH_M = 20.0  # the box's near face
BOX_M = 4.0


def _quads():
    """(four corners in east, north, up; colour) of each quad, counter-clockwise seen from outside."""
    h, g = HALF_M, GROUND_M
    yield [(-h, -h, g), (h, -h, g), (h, h, g), (-h, h, g)], (90, 140, 60, 255)
    w, s, n, top = BOX_M / 2, BOX_NORTH_M, BOX_NORTH_M + BOX_M, GROUND_M + BOX_M
    yield [(-w, s, g), (w, s, g), (w, s, top), (-w, s, top)], (200, 40, 20, 255)
    yield [(w, n, g), (-w, n, g), (-w, n, top), (w, n, top)], (200, 40, 20, 255)
    yield [(w, s, g), (w, n, g), (w, n, top), (w, s, top)], (200, 40, 20, 255)
    yield [(-w, n, g), (-w, s, g), (-w, s, top), (-w, n, top)], (200, 40, 20, 255)
    yield [(-w, s, top), (w, s, top), (w, n, top), (-w, n, top)], (20, 40, 200, 255)


def _glb():
    positions, colours, indices = [], b"", []
    for corners, colour in _quads():
        first = len(positions)
        positions += [(x, z, -y) for x, y, z in corners]  # glTF is y-up
        colours += bytes(colour) * 4
        indices += [first, first + 1, first + 2, first, first + 2, first + 3]
    body = b"".join(struct.pack("<3f", *p) for p in positions) + colours + struct.pack(f"<{len(indices)}I", *indices)
    count, sizes = len(positions), (12 * len(positions), 4 * len(positions), 4 * len(indices))
    offsets = (0, sizes[0], sizes[0] + sizes[1])
    low, high = ([f(p[i] for p in positions) for i in range(3)] for f in (min, max))
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2}]}],
        "buffers": [{"byteLength": len(body)}],
        "bufferViews": [{"buffer": 0, "byteOffset": o, "byteLength": s} for o, s in zip(offsets, sizes)],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5121, "normalized": True, "count": count, "type": "VEC4"},
            {"bufferView": 2, "componentType": 5125, "count": len(indices), "type": "SCALAR"}]}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def write(folder, name="place.glb"):
    """The path of the tileset.json; `name`: of its tile's file."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(_glb())
    middle = GROUND_M + BOX_M / 2
    box = [0, 0, middle, HALF_M, 0, 0, 0, HALF_M, 0, 0, 0, BOX_M / 2 + 0.1]
    tileset = folder / "tileset.json"
    tileset.write_text(json.dumps({
        "asset": {"version": "1.1", "copyright": "Tiny Place, CC0"}, "geometricError": 16,
        "root": {"boundingVolume": {"box": box}, "geometricError": 0, "refine": "REPLACE",
                 "content": {"uri": name}}}))
    return tileset
