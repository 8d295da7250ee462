"""What a lens that is nearly the right one does to odometry, and to its residual pattern: the last table of
docs/trust.md.

Tracks flights of the proving ground (folders with camera.yaml and dataset/) with their own lens and with four that are
a little off, and prints a line of Markdown each: residual_pattern_px, and the path's error in per cent of its length.
Usage: other_lenses.py TILEFLIGHT FLIGHT...   (needs numpy)
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np


def with_lens(text, change):
    """camera.yaml with other numbers: change(intrinsics, distortion) alters the two lists."""
    for_keys = {key: re.search(rf"{key}: \[(.*)\]", text) for key in ("intrinsics", "distortion_coeffs")}
    lists = {key: [float(x) for x in match[1].split(",")] for key, match in for_keys.items()}
    change(lists["intrinsics"], lists["distortion_coeffs"])
    for key, match in for_keys.items():
        text = text.replace(match[0], f"{key}: [{', '.join(map(str, lists[key]))}]")
    return text


def scale_focal(intrinsics, _):
    intrinsics[0] *= 1.02
    intrinsics[1] *= 1.02


def move_center(intrinsics, _):
    intrinsics[2] += 5.0


def bend(amount):
    def change(_, distortion):
        distortion[0] += amount
    return change


LENSES = [lambda *_: None, bend(0.01), bend(-0.03), scale_focal, move_center]


def path_error_percent(trajectory, truth):
    """RMS distance after the best similarity (Umeyama 1991) over the path's length."""
    at = {round(row[0], 5): row[1:4] for row in truth}
    pairs = [(row[1:4], at[round(row[0], 5)]) for row in trajectory if round(row[0], 5) in at]
    a, b = (np.array(side) for side in zip(*pairs))
    mean_a, mean_b = a.mean(0), b.mean(0)
    u, d, vt = np.linalg.svd((b - mean_b).T @ (a - mean_a) / len(a))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    scale = np.trace(np.diag(d) @ sign) / ((a - mean_a) ** 2).sum() * len(a)
    moved = scale * (a - mean_a) @ (u @ sign @ vt).T + mean_b
    return 100 * np.sqrt(((moved - b) ** 2).sum(1).mean()) / np.linalg.norm(np.diff(b, axis=0), axis=1).sum()


def track(program, flight, change, folder):
    lens = folder / "lens.yaml"
    lens.write_text(with_lens((flight / "camera.yaml").read_text(), change))
    subprocess.run([program, "odometry", flight / "dataset", "--out", folder / "odometry", "--force", "--quiet",
                    "--camera", lens], check=True)
    pattern = json.loads((folder / "odometry/odometry.json").read_text())["residual_pattern_px"]
    error = path_error_percent(np.loadtxt(folder / "odometry/trajectory.txt"),
                               np.loadtxt(flight / "dataset/groundtruth.txt"))
    return f"{'none' if pattern is None else f'{pattern:.3f}'} px, {error:.2f} %"


def main(program, flights):
    print("| flight | right lens | 0.01 | 0.03 | focal length | principal point |\n| --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for flight in map(pathlib.Path, flights):
            cells = [track(program, flight, change, pathlib.Path(folder)) for change in LENSES]
            print("| " + " | ".join([flight.name] + cells) + " |", flush=True)


main(sys.argv[1], sys.argv[2:])
