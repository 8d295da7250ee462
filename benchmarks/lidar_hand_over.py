"""Are simulated scans, and their hand-over to a lidar odometry, right? KISS-ICP along a street, and scans on the true surface.

    python3 benchmarks/lidar_hand_over.py build/release/bin/tileflight --out /tmp/lidar
    python3 benchmarks/lidar_hand_over.py build/release/bin/tileflight --out /tmp/lidar --dataset PLACE/simulated/dataset --truth PLACE/truth

The first needs KISS-ICP (docs/systems.md): it flies 54 m at 2 m height along a street of boxes with each lidar, 10 scans a second, and
prints the length of its path against the true one, and its error without any alignment but of the start. The second moves every tenth
scan of a dataset's KITTI export by its true poses, and prints how far the points are from the true surface.
"""

import argparse
import json
import math
import pathlib
import random
import struct
import subprocess

from outside_systems import CAMERA

LIDARS = ("os1-64", "vlp-16", "livox-mid-40")
WAYPOINTS = ((-40, 0, 2.0, 0), (-20, 1, 2.5, 8), (0, -1, 2.0, -8), (20, 0, 3.0, 5), (40, 1, 2.0, 0))


def run(program, *words):
    return subprocess.run([program, *map(str, words)], check=True, capture_output=True, text=True)


def write_street(file):
    """Houses of different width, height and distance on both sides, posts, and parked cars."""
    rng, vertices, faces = random.Random(3), [], []

    def box(x0, y0, x1, y1, z0, z1):
        n = len(vertices) + 1
        vertices.extend((x, y, z) for z in (z0, z1) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)))
        for a, b, c, d in ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)):
            faces.extend(((n + a, n + b, n + c), (n + a, n + c, n + d)))

    box(-150, -60, 150, 60, -1, 0)
    for side in (1, -1):
        x = -140.0
        while x < 140.0:
            width, distance, height = rng.uniform(6, 14), rng.uniform(7, 12), rng.uniform(5, 18)
            near, far = sorted((side * distance, side * (distance + 12)))
            box(x, near, x + width, far, 0, height)
            x += width + rng.uniform(1, 5)
        for _ in range(30):
            x = rng.uniform(-140, 140)
            box(x, side * 5 - 0.3, x + 0.6, side * 5 + 0.3, 0, rng.uniform(1.5, 6))
    for _ in range(25):
        x, side = rng.uniform(-140, 140), rng.choice((1, -1))
        box(x, side * 4 - 0.9, x + 4.2, side * 4 + 0.9, 0, 1.5)
    file.write_text("".join("v %g %g %g\n" % v for v in vertices) + "".join("f %d %d %d\n" % f for f in faces))


def read_tum(file):
    rows = (line.split() for line in file.read_text().splitlines() if line and not line.startswith("#"))
    return {round(float(row[0]), 4): tuple(map(float, row[1:4])) for row in rows}


def rotation(q):
    x, y, z, w = q
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]


def apply(R, t, p):
    return [sum(R[i][k] * p[k] for k in range(3)) + t[i] for i in range(3)]


def first_pose(file):
    line = next(line for line in file.read_text().splitlines() if line and not line.startswith("#"))
    values = list(map(float, line.split()))
    return rotation(values[4:8]), values[1:4]


def street(program, out):
    write_street(out / "street.obj")
    run(program, "tile", out / "street.obj", "--no-georeference", "--out", out / "tiles", "--force")
    (out / "camera.yaml").write_text(CAMERA)
    for lidar in LIDARS:
        (out / f"sensors-{lidar}.yaml").write_text(f"lidar: {{preset: {lidar}, rate_hz: 10, motion: distorted}}\n")
        points = "".join(f"  - {{position: [{x}, {y}, {z}], yaw_deg: {yaw}, pitch_deg: 0}}\n" for x, y, z, yaw in WAYPOINTS)
        (out / f"{lidar}.yaml").write_text(f"camera: camera.yaml\nsensors_file: sensors-{lidar}.yaml\nfps: 10\nspeed_m_s: 6\nacceleration_m_s2: 6\n"
                                           f"yaw_rate_deg_s: 45\nmax_frames: 100\nwaypoints:\n{points}")
        data, estimate = out / f"data-{lidar}", out / f"kiss-{lidar}"
        run(program, "render", out / "tiles", "--flight", out / f"{lidar}.yaml", "--out", data, "--quiet", "--force")
        run(program, "odometry", data, "--system", "kiss-icp", "--out", estimate, "--quiet", "--force")
        true, found = read_tum(data / "groundtruth.txt"), read_tum(estimate / "trajectory.txt")
        times = sorted(set(true) & set(found))
        # Both in the frame of their first camera: nothing else is aligned.
        frames = [(R, t) for R, t in (first_pose(data / "groundtruth.txt"), first_pose(estimate / "trajectory.txt"))]
        local = [[apply([list(c) for c in zip(*R)], [0, 0, 0], [a - b for a, b in zip(path[s], t)]) for s in times]
                 for path, (R, t) in zip((true, found), frames)]
        lengths = [sum(map(math.dist, path, path[1:])) for path in local]
        rmse = math.sqrt(sum(math.dist(a, b) ** 2 for a, b in zip(*local)) / len(times))
        print(f"{lidar}: {len(times)} scans, true path {lengths[0]:.2f} m, KISS-ICP's {lengths[1]:.2f} m, RMSE from the start {rmse:.2f} m")


def surface(program, out, dataset, truth):
    kitti = out / "kitti"
    run(program, "export", dataset, "--layout", "kitti", "--out", kitti, "--quiet", "--force")
    R0, t0 = first_pose(dataset / "groundtruth.txt")
    rows = [list(map(float, line.split())) for line in (kitti / "poses.txt").read_text().splitlines()]
    calib = next(line for line in (kitti / "calib.txt").read_text().splitlines() if line.startswith("Tr:"))
    split = lambda m: ([m[0:3], m[4:7], m[8:11]], [m[3], m[7], m[11]])
    mounting = split(list(map(float, calib.split()[1:])))
    points = []
    for i in range(0, len(rows), 10):
        pose = split(rows[i])
        for x, y, z, _ in struct.iter_unpack("<4f", (kitti / f"velodyne/{i:06d}.bin").read_bytes()):
            points.append(apply(R0, t0, apply(*pose, apply(*mounting, (x, y, z)))))
    (out / "scans.xyz").write_text("".join("%.4f %.4f %.4f\n" % tuple(p) for p in points))
    identity = [[float(i == k) for k in range(4)] for i in range(4)]
    (out / "identity.json").write_text(json.dumps({"matrix": identity, "scale": 1.0, "method": "given"}))
    run(program, "evaluate", out / "scans.xyz", "--truth", truth, "--transform", out / "identity.json", "--out", out / "metrics.json", "--quiet", "--force")
    found = json.loads((out / "metrics.json").read_text())["surface"]
    print(f"{len(points)} points: from the true surface {1000 * found['rmse']:.1f} mm RMS, median {1000 * found['median']:.1f} mm, "
          f"95 % within {1000 * found['percentiles']['95']:.1f} mm")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--dataset", type=pathlib.Path)
    parser.add_argument("--truth", type=pathlib.Path)
    words = parser.parse_args()
    words.out.mkdir(parents=True, exist_ok=True)
    if words.dataset:
        surface(words.program, words.out, words.dataset, words.truth)
    else:
        street(words.program, words.out)


if __name__ == "__main__":
    main()
