"""Inertial odometry on random flights: how its errors compare with its stated sigmas.

    python3 benchmarks/inertial_random_flights.py build/release/bin/tileflight --out /tmp/random [--flights 24] [--first 0]

Each flight has a place (the built-in stadium and, with TILEFLIGHT_TEST_DATA, Machangara, by turns), a lens (60, 90 or 155 degrees,
640 x 360), a path (curves, wandering, right angles), a speed, height and pitch, an inertial unit (adis16448 or bmi160, 200 readings
a second) and its mounting of its own, and, one of three, clocks that differ by up to 60 ms. Nothing is chosen by its result.
With --hover all paths nearly stop, turn by 60 to 120 degrees and fly on.
"""

import argparse
import json
import math
import os
import pathlib
import random
import shutil
import statistics
import subprocess

from inertial_accuracy import ROOT, path_errors, read_tum, run, tilt_deg

WIDTH, HEIGHT = 640, 360
# Middle and least and most height (local frame).
AREAS = {"stadium": ((0.0, 0.0), (24.0, 45.0)), "machangara": ((250.0, -150.0), (2925.0, 2950.0))}


def sources(program, out):
    if not (out / "stadium").exists():
        run(program, "scene", "stadium", out / "stadium")
    found = {"stadium": [out / "stadium/twin"]}
    data = pathlib.Path(os.environ.get("TILEFLIGHT_TEST_DATA", ROOT / "../../shared/data"))
    tileset = data / "tilesets/machangara_photogrammetry/tileset.json"
    if tileset.exists():
        found["machangara"] = [tileset, "--origin", -0.24, -78.52, 0]
    return found


def random_rotation(rng):
    w, x, y, z = (rng.gauss(0.0, 1.0) for _ in range(4))
    n = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / n, x / n, y / n, z / n
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]


def write_camera(file, rng):
    degrees = rng.choice([60, 90, 155])
    wide = degrees == 155
    focal = WIDTH / 2 / (math.radians(degrees / 2) if wide else math.tan(math.radians(degrees / 2)))
    rows = [[*row, rng.uniform(-0.15, 0.15)] for row in random_rotation(rng)] + [[0.0, 0.0, 0.0, 1.0]]
    file.write_text(f"cam0:\n  camera_model: pinhole\n  intrinsics: [{focal}, {focal}, {WIDTH / 2 - 0.5}, {HEIGHT / 2 - 0.5}]\n"
                    f"  distortion_model: {'equidistant' if wide else 'radtan'}\n  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n"
                    f"  resolution: [{WIDTH}, {HEIGHT}]\n  T_cam_imu: {rows}\n")
    return degrees


def waypoints(rng, place, kind):
    middle, heights = AREAS[place]
    x, y = (c + rng.uniform(-20.0, 20.0) for c in middle)
    z, pitch, course = rng.uniform(*heights), -rng.uniform(35.0, 85.0), rng.uniform(0.0, 360.0)
    yaw, points = course, []
    for k in range(14):
        points.append(f"  - {{position: [{x:.2f}, {y:.2f}, {z + rng.uniform(-2.0, 2.0):.2f}], "
                      f"yaw_deg: {yaw + rng.uniform(-10.0, 10.0):.1f}, pitch_deg: {pitch + rng.uniform(-4.0, 4.0):.1f}}}\n")
        course += (90.0 if k % 2 else 0.0) if kind == "angles" else rng.uniform(-60.0, 60.0) + (35.0 if kind == "curves" else 0.0)
        step = rng.uniform(6.0, 14.0)
        x, y = x + step * math.cos(math.radians(course)), y + step * math.sin(math.radians(course))
        if math.hypot(x - middle[0], y - middle[1]) > 45.0:
            course = math.degrees(math.atan2(middle[1] - y, middle[0] - x))
        yaw = course if rng.random() < 0.6 else yaw
    return "".join(points)


def hover_and_turn(rng, place):
    middle, heights = AREAS[place]
    x, y = (c + rng.uniform(-20.0, 20.0) for c in middle)
    z, pitch, yaw = rng.uniform(*heights), -rng.uniform(30.0, 60.0), rng.uniform(0.0, 360.0)
    turn, leg = rng.choice([-1, 1]) * rng.uniform(60.0, 120.0), rng.uniform(15.0, 30.0)
    points = []
    for turned, step in ((0.0, 0.0), (0.0, leg), (turn, 0.3), (0.0, leg)):
        yaw += turned
        x, y = x + step * math.cos(math.radians(yaw)), y + step * math.sin(math.radians(yaw))
        points.append(f"  - {{position: [{x:.2f}, {y:.2f}, {z:.2f}], yaw_deg: {yaw:.1f}, pitch_deg: {pitch:.1f}}}\n")
    return "".join(points)


def shift_clock(dataset, offset_s):
    """The unit's clock is ahead of the camera's by that."""
    head, *lines = (dataset / "imu.csv").read_text().splitlines()
    shifted = [head]
    for line in lines:
        time, rest = line.split(",", 1)
        if int(time) + round(1e9 * offset_s) >= 0:
            shifted.append(f"{int(time) + round(1e9 * offset_s)},{rest}")
    (dataset / "imu.csv").write_text("\n".join(shifted) + "\n")


def fly(program, out, number, places, hover):
    """Renders the flight; its description."""
    rng = random.Random(f"inertial {number}")
    place = sorted(places)[number % len(places)]
    lens = write_camera(out / f"camera-{number}.yaml", rng)
    fps, kind, unit = rng.choice([10, 20]), rng.choice(["curves", "wandering", "angles"]), rng.choice(["adis16448", "bmi160"])
    frames, speed = int(rng.uniform(10.0, 25.0) * fps), rng.uniform(2.0, 7.0)
    offset_s = rng.choice([0.0, 0.0, rng.uniform(-0.06, 0.06)])
    flight = out / f"flight-{number}.yaml"
    flight.write_text(f"camera: camera-{number}.yaml\nfps: {fps}\nspeed_m_s: {speed:.2f}\nacceleration_m_s2: {rng.uniform(1.0, 3.0):.2f}\n"
                      f"yaw_rate_deg_s: 40\nmax_frames: {frames}\nwaypoints:\n{hover_and_turn(rng, place) if hover else waypoints(rng, place, kind)}"
                      f"sensors:\n  imu: {{preset: {unit}, rate_hz: 200, seed: {number}}}\n")
    dataset = out / "dataset"
    shutil.rmtree(dataset, ignore_errors=True)
    run(program, "render", *places[place], "--flight", flight, "--out", dataset, "--quiet")
    if offset_s:
        shift_clock(dataset, offset_s)
    return {"flight": number, "place": place, "lens_deg": lens, "path": "hover and turn" if hover else kind, "unit": unit, "fps": fps, "frames": frames,
            "speed_m_s": round(speed, 1), "true_offset_s": offset_s}


def measure(program, out, number):
    dataset, odometry = out / "dataset", out / "odometry"
    words = ["odometry", dataset, "--mode", "inertial", "--out", odometry, "--seed", number, "--no-check", "--force", "--quiet"]
    subprocess.run([program, *map(str, words)], check=False, stdout=subprocess.DEVNULL)  # 1: lost, which is a result
    about = json.loads((odometry / "odometry.json").read_text())
    row = {"tracked": about["frames_tracked"], "scale": about["scale"]}
    if about["scale"] != "metric":
        return {**row, "reason": about.get("lost_reason") or about.get("inertial", {}).get("reason")}
    truth, found = dataset / "groundtruth.txt", about["inertial"]
    errors = path_errors(program, odometry, truth, out)
    return {**row, "scale_error": errors["sim3"]["scale"] - 1.0, "sigma_log_scale": found["sigma_log_scale"],
            "tilt_deg": tilt_deg(read_tum(odometry / "trajectory.txt"), read_tum(truth)), "sigma_up_deg": found["sigma_up_deg"],
            "offset_s": found["time_offset_s"], "sigma_offset_s": found["sigma_time_offset_s"],
            "ate_share": errors["se3"]["ate_rmse"] / errors["se3"]["path_length"]}


def root_mean_square(values):
    return math.sqrt(statistics.fmean(value * value for value in values))


def describe(rows):
    metric = [row for row in rows if row["scale"] == "metric"]
    print(f"metric: {len(metric)} of {len(rows)}")
    if not metric:
        return
    scale, tilt = [100 * row["scale_error"] for row in metric], [row["tilt_deg"] for row in metric]
    print(f"scale's error: {root_mean_square(scale):.2f} %, largest {max(map(abs, scale)):.2f} %; over its sigma "
          f"{root_mean_square(row['scale_error'] / row['sigma_log_scale'] for row in metric):.2f}")
    print(f"vertical's error: {root_mean_square(tilt):.3f} degrees, largest {max(tilt):.2f}; over its sigma "
          f"{root_mean_square(row['tilt_deg'] / row['sigma_up_deg'] for row in metric):.2f}")
    offsets = [row["offset_s"] - row["true_offset_s"] for row in metric]
    print(f"clocks' offset: {1e3 * root_mean_square(offsets):.2f} ms; over its sigma "
          f"{root_mean_square(o / row['sigma_offset_s'] for o, row in zip(offsets, metric)):.2f}")
    print(f"path without correction of scale: {100 * statistics.median(row['ate_share'] for row in metric):.3f} % (median), "
          f"largest {100 * max(row['ate_share'] for row in metric):.3f} %")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--flights", type=int, default=24)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--hover", action="store_true", help="paths that stop, turn in place and fly on")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    places = sources(arguments.program, arguments.out)
    rows = []
    for number in range(arguments.first, arguments.first + arguments.flights):
        about = fly(arguments.program, arguments.out, number, places, arguments.hover)
        rows.append({**about, **measure(arguments.program, arguments.out, number)})
        print(json.dumps(rows[-1]), flush=True)
    describe(rows)


if __name__ == "__main__":
    main()
