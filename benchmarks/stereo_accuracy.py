"""Metric odometry with a stereo pair, against the truth: scale, path, processor time, over several seeds.

    python3 benchmarks/stereo_accuracy.py build/release/bin/tileflight --out /tmp/stereo [--seeds 8]

Two cameras of 90 degrees, 0.2 m apart, 30 m and 5 m over the ground of both places. Each seed has a path, image noise and
random samples of its own.
"""

import argparse
import json
import math
import os
import pathlib
import random
import resource
import subprocess

from accuracy_lines import metric_rows, print_line, print_scale_and_path

ROOT = pathlib.Path(__file__).resolve().parent.parent
BASELINE_M = 0.2
FRAMES = 80
SIZE = "1008,567"
# Middle of the flight's path on the ground (east, north), height of the ground there, heading, degrees right of north.
PLACES = {"stadium": (0.0, 0.0, 0.0, 10.0), "machangara": (262.0, -160.0, 2888.0, 110.0)}
# Height over ground, speed, pitch: a view of ground that is seen again over many frames.
HEIGHTS = {30: (6.0, -60.0), 5: (1.5, -50.0)}


def sources(program, out):
    data = pathlib.Path(os.environ.get("TILEFLIGHT_TEST_DATA", ROOT / "../../shared/data"))
    if not (out / "stadium").exists():
        run(program, "scene", "stadium", out / "stadium")
    found = {"stadium": [out / "stadium/twin", "--origin", "35.310344,-80.740007,190"]}
    tileset = data / "tilesets/machangara_photogrammetry/tileset.json"
    if tileset.exists():
        found["machangara"] = [tileset, "--origin", "-0.24,-78.52,0"]
    return found


def run(program, *words):
    """Processor seconds of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([program, *map(str, words)], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def write_flight(out, place, height, seed):
    """A curved path of its own for each seed."""
    rng = random.Random(f"{place} {height} {seed}")
    east, north, ground, heading = PLACES[place]
    speed, pitch = HEIGHTS[height]
    step = speed * FRAMES / 10.0 / 4.0
    heading += rng.uniform(-25.0, 25.0)
    lines = []
    for k in range(6):
        along, across = (k - 2.5) * step, rng.uniform(-0.12, 0.12) * step
        yaw = heading + rng.uniform(-6.0, 6.0)
        sine, cosine = math.sin(math.radians(heading)), math.cos(math.radians(heading))
        position = [east + along * sine + across * cosine, north + along * cosine - across * sine,
                    ground + height * rng.uniform(0.95, 1.05)]
        lines.append(f"  - {{position: {[round(x, 3) for x in position]}, yaw_deg: {yaw:.2f}, "
                     f"pitch_deg: {pitch + rng.uniform(-3.0, 3.0):.2f}}}")
    camera = ROOT / "examples/camera-90.yaml"
    file = out / f"{place}-{height}-{seed}.yaml"
    file.write_text(f"cameras:\n  - {{name: left, camera: {camera}}}\n"
                    f"  - {{name: right, camera: {camera}, position: [{BASELINE_M}, 0, 0]}}\n"
                    f"fps: 10\nspeed_m_s: {speed}\nacceleration_m_s2: {speed}\nyaw_rate_deg_s: 20\nmax_frames: {FRAMES}\n"
                    "waypoints:\n" + "\n".join(lines) + "\n")
    return file


def render(program, out, source, flight, seed):
    folder = out / flight.stem
    if not folder.exists():
        noise = out / "noise.yaml"
        noise.write_text("white_electrons: 10000\nread_noise_electrons: 6\n")
        run(program, "render", *source, "--flight", flight, "--out", folder, "--resolution", SIZE, "--degrade", noise,
            "--seed", seed)
    return folder


def path_errors(program, odometry, truth, out):
    """ATE with scale, ATE without, path length, and the scale's error."""
    result = {}
    for kind in ("se3", "sim3"):
        run(program, "evaluate", "--trajectory", odometry / "trajectory.txt", "--truth-trajectory", truth, "--alignment", kind,
            "--out", out / "metrics.json", "--force", "--quiet")
        result[kind] = json.loads((out / "metrics.json").read_text())["trajectory"]
    return result


def measure(program, out, dataset, seed):
    odometry = out / "odometry"
    words = ["odometry", dataset, "--out", odometry, "--seed", seed, "--no-check", "--force", "--quiet"]
    cpu_mono_s = run(program, *words)
    cpu_s = run(program, *words, "--mode", "stereo")
    about = json.loads((odometry / "odometry.json").read_text())
    errors = path_errors(program, odometry, dataset / "groundtruth.txt", out)
    path_m = errors["se3"]["path_length"]
    return {"scale": about["scale"], "frames_tracked": about["frames_tracked"], "path_m": path_m,
            "scale_error": errors["sim3"]["scale"] - 1.0,
            "ate_share": errors["se3"]["ate_rmse"] / path_m, "ate_sim3_share": errors["sim3"]["ate_rmse"] / path_m,
            "matched_share": about["stereo"]["cameras"][0]["matched_share"], "cpu_s": cpu_s, "cpu_mono_s": cpu_mono_s,
            "warnings": [warning["message"] for warning in about["warnings"]]}


def describe(name, rows):
    metric = metric_rows(name, rows)
    if not metric:
        return
    print_scale_and_path(metric)
    print_line("matched", [100 * row["matched_share"] for row in metric], "% of the points searched")
    print_line("processor time over mono", [row["cpu_s"] / row["cpu_mono_s"] for row in metric], "")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--seeds", type=int, default=8)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for place, source in sources(arguments.program, arguments.out).items():
        for height in HEIGHTS:
            rows = []
            for seed in range(1, arguments.seeds + 1):
                flight = write_flight(arguments.out, place, height, seed)
                dataset = render(arguments.program, arguments.out, source, flight, seed)
                rows.append(measure(arguments.program, arguments.out, dataset, seed))
                print(json.dumps({"place": place, "height_m": height, "seed": seed, **rows[-1]}), flush=True)
            describe(f"{place}, {height} m", rows)


if __name__ == "__main__":
    main()
