#!/usr/bin/env python3
"""A textured OBJ of any size, the same bytes every time: hills with steep steps, in 4 x 4 materials of one image each.

Usage: make_large_obj.py OUT_FOLDER [--cells N] [--image PIXELS]

The default, 512 cells along a side of a material, has 8.4 million triangles, 268 million texels and 490 MB of text;
triangles grow with the square of --cells. Needs nothing but Python.
"""
import argparse
import math
import pathlib
import random
import struct
import zlib

MATERIALS = 4  # along a side
EDGE_M = 0.5  # of a cell


def height(x, y):
    """Hills of 20 m, terraces of 3 m, furrows of 0.2 m."""
    hills = 12 * math.sin(0.011 * x) * math.cos(0.013 * y) + 8 * math.sin(0.031 * x + 0.023 * y)
    terraces = 3 * math.tanh(4 * math.sin(0.07 * x - 0.05 * y))
    return hills + terraces + 0.2 * math.sin(1.9 * x) * math.sin(2.3 * y)


def write_png(file, size, seed):
    """Noise in a colour of its own, darker in a grid of lines, so that a picture shows where a texel lies."""
    rng = random.Random(seed)
    tint = [rng.uniform(0.35, 1.0) for _ in range(3)]
    light = [bytes(min(255, int(t * (90 + v // 12 + band))) for v in range(256)) for t in tint for band in (0, 40)]
    noise = [rng.randbytes(size) for _ in range(61)]
    packer = zlib.compressobj(1)
    packed = []
    for y in range(size):
        grey = noise[y % len(noise)]
        shift = (y * 131) % size
        grey = grey[shift:] + grey[:shift]
        row = bytearray(1 + 3 * size)
        bright = (y // 128) % 2
        for channel in range(3):
            values = bytearray(grey.translate(light[2 * channel + bright]))
            for line in range(0, size, 256):
                values[line:line + 8] = bytes(8)
            row[1 + channel::3] = values
        packed.append(packer.compress(bytes(row)))
    packed.append(packer.flush())

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0)
    file.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", b"".join(packed)) + chunk(b"IEND", b""))


def write_obj(file, cells):
    side = MATERIALS * cells + 1
    with open(file, "w", buffering=1 << 22, encoding="ascii") as out:
        out.write("mtllib large.mtl\n")
        for j in range(side):
            y = EDGE_M * j
            out.write("".join(f"v {EDGE_M * i:.4f} {y:.4f} {height(EDGE_M * i, y):.4f}\n" for i in range(side)))
        for v in range(cells + 1):
            out.write("".join(f"vt {u / cells:.6f} {v / cells:.6f}\n" for u in range(cells + 1)))
        for material in range(MATERIALS * MATERIALS):
            out.write(f"usemtl m{material}\n")
            first_i, first_j = material % MATERIALS * cells, material // MATERIALS * cells
            for j in range(cells):
                lines = []
                for i in range(cells):
                    a = (first_j + j) * side + first_i + i + 1
                    b, c, d = a + 1, a + side + 1, a + side
                    t = j * (cells + 1) + i + 1
                    u, v, w = t + 1, t + cells + 2, t + cells + 1
                    lines.append(f"f {a}/{t} {b}/{u} {c}/{v}\nf {a}/{t} {c}/{v} {d}/{w}\n")
                out.write("".join(lines))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--cells", type=int, default=512, help="cells along a side of a material (default 512)")
    parser.add_argument("--image", type=int, default=4096, help="pixels along a side of an image (default 4096)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    materials = range(MATERIALS * MATERIALS)
    (options.out / "large.mtl").write_text("".join(f"newmtl m{i}\nmap_Kd m{i}.png\n" for i in materials))
    for i in materials:
        write_png(options.out / f"m{i}.png", options.image, i)
    write_obj(options.out / "large.obj", options.cells)


if __name__ == "__main__":
    main()
