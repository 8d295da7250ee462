#!/usr/bin/env python3
"""Writes a synthetic city: N x N copies of a tileset, side by side, as external tilesets of one.

    make_city.py 8 out/city64 --place ../shared/data/tilesets/machangara_photogrammetry

The copies are the same files (a link), each under its own transform, while the disk holds them once. tileflight decodes
such a file once for several of its tiles, and holds its textures once; with `--links` each copy has a link of its own,
so that its files are different ones, as in a real city. The tileset is not georeferenced. `--tree` puts the copies
under a quadtree instead of one flat list of children.
"""
import argparse
import json
import os
import pathlib


def half_axes(box):
    """Half the extent of a box volume along x, y, z."""
    return [sum(abs(box[3 + 3 * axis + i]) for axis in range(3)) for i in range(3)]


def box_around(boxes):
    """The axis-aligned box volume around others."""
    low = [min(b[i] - half_axes(b)[i] for b in boxes) for i in range(3)]
    high = [max(b[i] + half_axes(b)[i] for b in boxes) for i in range(3)]
    center = [(a + b) / 2 for a, b in zip(low, high)]
    half = [(b - a) / 2 for a, b in zip(low, high)]
    return center + [half[0], 0, 0, 0, half[1], 0, 0, 0, half[2]]


def copy_of(place, box, column, row, count, link):
    half = half_axes(box)
    x, y = ((2 * column - count + 1) * half[0], (2 * row - count + 1) * half[1])
    moved = [box[0] + x, box[1] + y] + box[2:]
    # A tile's volume is in its own frame, so the transform moves it with the content.
    tile = {"transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, 0, 1], "boundingVolume": {"box": box},
            "geometricError": place["geometricError"], "content": {"uri": f"{link}/tileset.json"}}
    return tile, moved


def grouped(tiles, boxes, error):
    """Neighbours, two by two, under one tile, until one is left."""
    count = int(len(tiles) ** 0.5)
    while count > 1:
        next_tiles, next_boxes = [], []
        error *= 2
        for row in range(0, count, 2):
            for column in range(0, count, 2):
                members = [r * count + c for r in range(row, min(row + 2, count)) for c in range(column, min(column + 2, count))]
                box = box_around([boxes[i] for i in members])
                next_tiles.append({"boundingVolume": {"box": box}, "geometricError": error, "refine": "REPLACE",
                                   "children": [tiles[i] for i in members]})
                next_boxes.append(box)
        tiles, boxes, count = next_tiles, next_boxes, (count + 1) // 2
    return tiles[0], error


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=int, help="copies along each axis")
    parser.add_argument("out", type=pathlib.Path, help="folder to write")
    parser.add_argument("--place", type=pathlib.Path,
                        default=pathlib.Path(os.environ.get("TILEFLIGHT_TEST_DATA", "../shared/data")) / "tilesets/machangara_photogrammetry")
    parser.add_argument("--links", action="store_true", help="a link for each copy")
    parser.add_argument("--tree", action="store_true", help="a quadtree over the copies")
    arguments = parser.parse_args()
    place = json.loads((arguments.place / "tileset.json").read_text())
    box = place["root"]["boundingVolume"]["box"]
    cells = [(column, row) for row in range(arguments.count) for column in range(arguments.count)]
    links = [f"place{i}" if arguments.links else "place" for i in range(len(cells))]
    copies = [copy_of(place, box, *cell, arguments.count, link) for cell, link in zip(cells, links)]
    tiles, boxes = [c[0] for c in copies], [c[1] for c in copies]
    error = place["geometricError"]
    if arguments.tree:
        root, error = grouped(tiles, boxes, error)
    else:
        error *= arguments.count
        root = {"boundingVolume": {"box": box_around(boxes)}, "geometricError": error, "refine": "REPLACE", "children": tiles}
    arguments.out.mkdir(parents=True, exist_ok=True)
    for link in (arguments.out / name for name in links):
        if not link.is_symlink():
            link.symlink_to(arguments.place.resolve(), target_is_directory=True)
    tileset = {"asset": {"version": "1.0"}, "geometricError": error, "root": root}
    (arguments.out / "tileset.json").write_text(json.dumps(tileset))


if __name__ == "__main__":
    main()
