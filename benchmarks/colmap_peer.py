#!/usr/bin/env python3
"""COLMAP reconstructs a rendered flight from its pictures and its lens alone; how far is its path from the true one?

    apt-get install --no-install-recommends colmap
    tileflight render TILESET ... --flight FLIGHT --out DATASET       # a pinhole, some 60 frames
    tileflight export DATASET --layout colmap --out EXPORTED
    python3 benchmarks/colmap_peer.py EXPORTED DATASET/groundtruth.txt

Prints the frames that COLMAP placed and the RMS distance of its camera centres from the true ones after the best
similarity (Horn 1987), metres and per cent of the path's length.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile


def colmap(*words):
    environment = dict(os.environ, QT_QPA_PLATFORM="offscreen")
    done = subprocess.run(["colmap", *words], capture_output=True, text=True, check=False, env=environment)
    if done.returncode != 0:
        sys.exit("colmap " + words[0] + " failed:\n" + done.stdout[-1500:] + done.stderr[-1500:])


def lens_of(exported):
    for line in open(next(os.path.join(base, "cameras.txt") for base, _, names in os.walk(exported)
                          if "cameras.txt" in names)):
        if not line.startswith("#"):
            words = line.split()
            return words[1], ",".join(words[4:])
    sys.exit(exported + ": cameras.txt names no camera")


def reconstruct(exported, scratch):
    database, images = os.path.join(scratch, "database.db"), os.path.join(exported, "images")
    model, numbers = lens_of(exported)
    colmap("feature_extractor", "--database_path", database, "--image_path", images, "--ImageReader.single_camera", "1",
           "--ImageReader.camera_model", model, "--ImageReader.camera_params", numbers, "--SiftExtraction.use_gpu", "0")
    colmap("sequential_matcher", "--database_path", database, "--SiftMatching.use_gpu", "0",
           "--SequentialMatching.overlap", "8")
    colmap("mapper", "--database_path", database, "--image_path", images, "--output_path", scratch,
           "--Mapper.ba_refine_focal_length", "0", "--Mapper.ba_refine_extra_params", "0")
    text = os.path.join(scratch, "text")
    os.makedirs(text)
    colmap("model_converter", "--input_path", os.path.join(scratch, "0"), "--output_path", text, "--output_type", "TXT")
    return os.path.join(text, "images.txt")


def rotated(q, v):
    w, x, y, z = q
    t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])]
    return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2],
            v[2] + w * t[2] + x * t[1] - y * t[0]]


def centres(images_txt):
    """Camera centre by picture's name: -R^T t."""
    found = {}
    with open(images_txt) as file:
        rows = [line for line in file if not line.startswith("#")]
    for row in rows[::2]:
        words = row.split()
        w, x, y, z, *t = (float(word) for word in words[1:8])
        found[words[9]] = [-c for c in rotated([w, -x, -y, -z], t)]
    return found


def best_rotation(a, b):
    """Horn's quaternion: the eigenvector of the largest eigenvalue, by shifted power iteration."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (
        [sum(p[i] * q[j] for p, q in zip(a, b)) for j in range(3)] for i in range(3))
    n = [[xx + yy + zz, yz - zy, zx - xz, xy - yx], [yz - zy, xx - yy - zz, xy + yx, zx + xz],
         [zx - xz, xy + yx, -xx + yy - zz, yz + zy], [xy - yx, zx + xz, yz + zy, -xx - yy + zz]]
    shift = max(sum(abs(value) for value in row) for row in n)
    q = [1.0, 0.3, 0.2, 0.1]
    for _ in range(20000):
        q = [sum(n[i][j] * q[j] for j in range(4)) + shift * q[i] for i in range(4)]
        length = math.sqrt(sum(value * value for value in q))
        q = [value / length for value in q]
    return q


def path_error(found, true):
    """RMS of true - similarity(found)."""
    middle = lambda points: [sum(p[k] for p in points) / len(points) for k in range(3)]
    less = lambda points, m: [[p[k] - m[k] for k in range(3)] for p in points]
    a, b = less(found, middle(found)), less(true, middle(true))
    q = best_rotation(a, b)
    turned = [rotated(q, p) for p in a]
    scale = sum(sum(u * v for u, v in zip(p, r)) for p, r in zip(turned, b)) / sum(sum(u * u for u in p) for p in a)
    return math.sqrt(sum(sum((v - scale * u) ** 2 for u, v in zip(p, r)) for p, r in zip(turned, b)) / len(a))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("exported")
    parser.add_argument("groundtruth")
    arguments = parser.parse_args()
    with open(arguments.groundtruth) as file:
        truth = [[float(word) for word in line.split()[1:4]] for line in file if line.strip() and line[0] != "#"]
    with tempfile.TemporaryDirectory() as scratch:
        found = centres(reconstruct(arguments.exported, scratch))
    names = sorted(os.listdir(os.path.join(arguments.exported, "images")))
    pairs = [(found[name], truth[i]) for i, name in enumerate(names) if name in found]
    error_m = path_error([p[0] for p in pairs], [p[1] for p in pairs])
    length_m = sum(math.dist(p, q) for p, q in zip(truth, truth[1:]))
    print(json.dumps({"frames": len(names), "placed": len(pairs), "ate_rmse_m": round(error_m, 5),
                      "path_length_m": round(length_m, 2), "per_cent": round(100 * error_m / length_m, 4)}))


if __name__ == "__main__":
    main()
