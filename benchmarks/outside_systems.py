"""Outside systems and our own odometry on the same simulated rigs: two cameras and an inertial unit.

    python3 benchmarks/outside_systems.py build/release/bin/tileflight --out /tmp/outside [--seeds 2] [--systems mono,stereo,orb-slam3,…]

Each flight is rendered once: two pinholes of 90 degrees, 640 x 480, 0.2 m apart, 20 images a second, and EuRoC's ADIS16448 at
200 readings a second, over 20 s of a figure of eight. Systems that are not installed are left out (docs/systems.md).
"""

import argparse
import json
import math
import pathlib
import random
import statistics
import subprocess

from stereo_accuracy import BASELINE_M, PLACES, sources

OURS = ("mono", "stereo", "inertial")
SYSTEMS = (*OURS, "openvins", "openvins-stereo", "orb-slam3", "orb-slam3-stereo", "orb-slam3-inertial", "orb-slam3-stereo-inertial")
FRAMES = 400
# Height over ground: half length and half width of the figure, speed, pitch.
HEIGHTS = {12: (14.0, 7.0, 5.0, -45.0), 30: (24.0, 12.0, 7.0, -60.0)}
CAMERA = """cam0:
  camera_model: pinhole
  intrinsics: [320.0, 320.0, 319.5, 239.5]
  distortion_model: radtan
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [640, 480]
"""
T_CAM_IMU = "  T_cam_imu: [[0.0, -1.0, 0.0, 0.05], [0.0, 0.0, -1.0, 0.02], [1.0, 0.0, 0.0, -0.03], [0.0, 0.0, 0.0, 1.0]]\n"


def run(program, *words, check=True):
    return subprocess.run([program, *map(str, words)], check=check, capture_output=True, text=True)


def write_flight(out, place, height, seed):
    """A figure of eight whose waypoints are off by up to a metre and some degrees, so that speed and direction change all the time."""
    rng = random.Random(f"outside {place} {height} {seed}")
    east, north, ground, heading = PLACES[place]
    length, width, speed, pitch = HEIGHTS[height]
    heading += rng.uniform(-25.0, 25.0)
    sine, cosine = math.sin(math.radians(heading)), math.cos(math.radians(heading))
    lines = []
    for k in range(60):
        angle = 2.0 * math.pi * k / 20.0
        along = length * math.sin(angle) + rng.uniform(-1.0, 1.0)
        across = width * math.sin(2.0 * angle) + rng.uniform(-1.0, 1.0)
        position = [east + along * sine + across * cosine, north + along * cosine - across * sine,
                    ground + height + rng.uniform(-0.8, 0.8)]
        yaw = heading + 20.0 * math.sin(angle) + rng.uniform(-4.0, 4.0)
        lines.append(f"  - {{position: {[round(x, 3) for x in position]}, yaw_deg: {yaw:.2f}, "
                     f"pitch_deg: {pitch + rng.uniform(-4.0, 4.0):.2f}}}")
    (out / "left.yaml").write_text(CAMERA + T_CAM_IMU)
    (out / "right.yaml").write_text(CAMERA)
    file = out / f"{place}-{height}-{seed}.yaml"
    file.write_text("cameras:\n  - {name: left, camera: left.yaml}\n"
                    f"  - {{name: right, camera: right.yaml, position: [{BASELINE_M}, 0, 0]}}\n"
                    f"fps: 20\nspeed_m_s: {speed}\nacceleration_m_s2: 5\nyaw_rate_deg_s: 40\nmax_frames: {FRAMES}\n"
                    f"waypoints:\n" + "\n".join(lines) + f"\nsensors:\n  imu: {{preset: adis16448, rate_hz: 200, seed: {seed}}}\n")
    return file


def render(program, out, source, flight, seed):
    folder = out / flight.stem
    if not folder.exists():
        noise = out / "noise.yaml"
        noise.write_text("white_electrons: 10000\nread_noise_electrons: 6\n")
        run(program, "render", *source, "--flight", flight, "--out", folder, "--degrade", noise, "--png", "--seed", seed)
    return folder


def read_about(folder):
    file = folder / "odometry.json"
    return json.loads(file.read_text()) if file.exists() else {}


def odometry(program, dataset, out, system, seed):
    """Runs a system unless it has been, and gives its folder; None: not installed, not for this dataset, or it failed."""
    folder = out / f"{dataset.name}-{system}"
    completed = lambda about: about.get("system", {}).get("completed", bool(about))
    if not completed(read_about(folder)):
        words = ["--mode", system, "--no-check"] if system in OURS else ["--system", system]
        done = run(program, "odometry", dataset, *words, "--out", folder, "--seed", seed, "--force", check=False)
        about = read_about(folder)
        if not completed(about):
            print(f"{dataset.name}, {system}: {about.get('lost_reason') or done.stderr.strip()}", flush=True)
            return None
    return folder


def scores(program, dataset, folder):
    """ATE with the scale held and corrected, the scale's error, path length, share of the frames tracked."""
    trajectory = folder / "trajectory.txt"
    frames = sum(not line.startswith("#") for line in (dataset / "groundtruth.txt").read_text().splitlines())
    poses = sum(not line.startswith("#") for line in trajectory.read_text().splitlines())
    about = read_about(folder)
    row = {"tracked": poses / frames, "scale": about.get("system", about).get("scale")}
    for kind in ("se3", "sim3"):
        metrics = folder / f"{kind}.json"
        done = run(program, "evaluate", "--trajectory", trajectory, "--truth-trajectory", dataset / "groundtruth.txt", "--alignment",
                   kind, "--out", metrics, "--force", "--quiet", check=False)
        if done.returncode:
            return row | {"error": done.stderr.strip()}
        found = json.loads(metrics.read_text())["trajectory"]
        row |= {f"ate_{kind}_m": found["ate_rmse"], "path_m": found["path_length"]}
    return row | {"scale_error": found["scale"] - 1.0}


def describe(place, height, system, rows):
    """A row of the table: means of magnitudes over the seeds; scale's error only where the system gives metres."""
    rows = [row for row in rows if "scale_error" in row]
    if not rows:
        return
    mean = {key: statistics.mean(abs(row[key]) for row in rows) for key in ("ate_se3_m", "ate_sim3_m", "scale_error", "tracked")}
    metric = all(row["scale"] == "metric" for row in rows)
    scale = f"{100 * mean['scale_error']:.2f} % | {mean['ate_se3_m']:.3f}" if metric else "unknown | –"
    print(f"| {place}, {height} m | {system} | {100 * mean['tracked']:.0f} % | {scale} | {mean['ate_sim3_m']:.3f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--places", default=",".join(PLACES))
    parser.add_argument("--heights", default=",".join(map(str, HEIGHTS)))
    parser.add_argument("--systems", default=",".join(SYSTEMS))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    found, rows = sources(arguments.program, arguments.out), {}
    for seed in range(1, arguments.seeds + 1):
        for height in map(int, arguments.heights.split(",")):
            for place in (name for name in arguments.places.split(",") if name in found):
                flight = write_flight(arguments.out, place, height, seed)
                dataset = render(arguments.program, arguments.out, found[place], flight, seed)
                for system in filter(None, arguments.systems.split(",")):
                    folder = odometry(arguments.program, dataset, arguments.out, system, seed)
                    if folder:
                        row = scores(arguments.program, dataset, folder)
                        print(json.dumps({"place": place, "height_m": height, "seed": seed, "system": system, **row}), flush=True)
                        rows.setdefault((place, height, system), []).append(row)
    for key, values in rows.items():
        describe(*key, values)


if __name__ == "__main__":
    main()
