"""Metric odometry with an inertial unit, against the truth: scale, vertical, path, processor time, over several seeds.

    python3 benchmarks/inertial_accuracy.py build/release/bin/tileflight --out /tmp/inertial [--seeds 8]

A flight is rendered once. Each seed has an inertial unit of its own (EuRoC's ADIS16448, 200 Hz, mounted turned and 12 cm
beside the camera) and its own random samples of the odometry's initialisation. The readings do not depend on the images'
size, so those of further seeds come with small images.
"""

import argparse
import json
import math
import os
import pathlib
import resource
import shutil
import statistics
import subprocess

from accuracy_lines import metric_rows, print_line, print_scale_and_path

ROOT = pathlib.Path(__file__).resolve().parent.parent
T_CAM_IMU = "[[0.0, -1.0, 0.0, 0.02], [0.0, 0.0, -1.0, -0.05], [1.0, 0.0, 0.0, -0.10], [0.0, 0.0, 0.0, 1.0]]"


def places(program, out):
    data = pathlib.Path(os.environ.get("TILEFLIGHT_TEST_DATA", ROOT / "../../shared/data"))
    if not (out / "stadium").exists():
        run(program, "scene", "stadium", out / "stadium")
    yield "stadium", [out / "stadium/twin"], "stadium-flight-simulated.yaml", "camera-155.yaml", "1008,567"
    tileset = data / "tilesets/machangara_photogrammetry/tileset.json"
    if tileset.exists():
        source = [tileset, "--origin", -0.24, -78.52, 0]
        yield "machangara", source, "machangara-flight-simulated.yaml", "machangara-camera.yaml", "1008,566"


def run(program, *words):
    """Processor seconds of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([program, *map(str, words)], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def write_flight(out, place, seed, flight, camera):
    text = (ROOT / "examples" / camera).read_text()
    (out / f"{place}-camera.yaml").write_text(text.rstrip() + f"\n  T_cam_imu: {T_CAM_IMU}\n")
    text = (ROOT / "examples" / flight).read_text().replace(f"camera: {camera}", f"camera: {place}-camera.yaml")
    file = out / f"{place}-{seed}.yaml"
    file.write_text(text + f"\nsensors:\n  imu: {{preset: adis16448, rate_hz: 200, seed: {seed}}}\n")
    return file


def render(program, out, place, seed, source, flight, size):
    """The dataset of a seed: the first seed's images with the seed's own readings."""
    whole, folder = out / f"{place}-1", out / f"{place}-{seed}"
    if not folder.exists():
        small = "112,63" if size == "1008,567" else "504,283"
        run(program, "render", *source, "--flight", flight, "--out", folder, "--resolution", size if seed == 1 else small)
    if seed > 1 and not (folder / "whole").exists():
        readings = (folder / "imu.csv").read_bytes()
        shutil.rmtree(folder)
        folder.mkdir()
        for file in whole.iterdir():
            if file.name == "images":
                (folder / "images").symlink_to(file)
            elif file.is_file() and not file.name.startswith("."):
                shutil.copy(file, folder)
        (folder / "imu.csv").write_bytes(readings)
        (folder / "whole").touch()
    return folder


def read_tum(file):
    rows = [line.split() for line in file.read_text().splitlines() if line and not line.startswith("#")]
    return {round(float(r[0]), 6): [float(x) for x in r[1:]] for r in rows}


def up_in_camera(q):
    """The world's z axis in the camera's axes, of the quaternion x y z w of T_world_camera."""
    x, y, z, w = q
    return (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))


def tilt_deg(estimate, truth):
    """Mean angle between the verticals of both paths' poses."""
    angles = []
    for time, pose in estimate.items():
        if time in truth:
            dot = sum(a * b for a, b in zip(up_in_camera(pose[3:]), up_in_camera(truth[time][3:])))
            angles.append(math.degrees(math.acos(min(1.0, dot))))
    return statistics.mean(angles)


def path_errors(program, odometry, truth, out):
    """ATE with scale, ATE without, path length, and the scale's error."""
    result = {}
    for kind in ("se3", "sim3"):
        run(program, "evaluate", "--trajectory", odometry / "trajectory.txt", "--truth-trajectory", truth, "--alignment", kind,
            "--out", out / "metrics.json", "--force", "--quiet")
        result[kind] = json.loads((out / "metrics.json").read_text())["trajectory"]
    return result


def measure(program, out, dataset, seed, frames=None):
    odometry = out / "odometry"
    words = ["odometry", dataset, "--out", odometry, "--seed", seed, "--no-check", "--force", "--quiet"]
    if frames:
        words += ["--to", frames]
    cpu_s = run(program, *words, "--mode", "inertial")
    about = json.loads((odometry / "odometry.json").read_text())
    row = {"scale": about["scale"], "cpu_s": cpu_s, "inertial": about["inertial"]}
    if about["scale"] != "metric":
        return row
    truth = dataset / "groundtruth.txt"
    errors = path_errors(program, odometry, truth, out)
    row["scale_error"] = errors["sim3"]["scale"] - 1.0
    row["ate_share"] = errors["se3"]["ate_rmse"] / errors["se3"]["path_length"]
    row["ate_sim3_share"] = errors["sim3"]["ate_rmse"] / errors["sim3"]["path_length"]
    row["tilt_deg"] = tilt_deg(read_tum(odometry / "trajectory.txt"), read_tum(truth))
    row["cpu_mono_s"] = run(program, *words) if seed <= 2 and not frames else None
    return row


def describe(place, rows):
    metric = metric_rows(place, rows)
    if not metric:
        return
    print_scale_and_path(metric)
    print_line("sigma of the scale, as stated", [100 * row["inertial"]["sigma_log_scale"] for row in metric], "%")
    print_line("vertical's error", [row["tilt_deg"] for row in metric], "degrees")
    print_line("clocks' offset", [1000 * row["inertial"]["time_offset_s"] for row in metric], "ms")
    ratios = [row["cpu_s"] / row["cpu_mono_s"] for row in metric if row["cpu_mono_s"]]
    if ratios:
        print_line("processor time over mono", ratios, f"(of {len(ratios)} seeds)")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--frames", type=int, help="only so many frames of each flight")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for place, source, flight, camera, size in places(arguments.program, arguments.out):
        rows = []
        for seed in range(1, arguments.seeds + 1):
            file = write_flight(arguments.out, place, seed, flight, camera)
            dataset = render(arguments.program, arguments.out, place, seed, source, file, size)
            rows.append(measure(arguments.program, arguments.out, dataset, seed, arguments.frames))
            print(json.dumps({"place": place, "seed": seed, **rows[-1]}), flush=True)
        describe(place, rows)


if __name__ == "__main__":
    main()
