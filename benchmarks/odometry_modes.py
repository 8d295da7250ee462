"""The same flight in all four modes of the built-in odometry, against the truth.

    python3 benchmarks/odometry_modes.py build/release/bin/tileflight --out /tmp/modes [--frames 160]

The stadium's example flight with two cameras of 90 degrees, 1008 pixels wide, 0.2 m apart, and the inertial unit of
inertial_accuracy.py: mono, mono with the intrinsics held (--fixed-intrinsics, as all others do), inertial, with the readings in
the window (--tight), stereo, stereo-inertial.
"""

import argparse
import json
import pathlib

from inertial_accuracy import ROOT, T_CAM_IMU, path_errors, read_tum, run, tilt_deg

MODES = {
    "mono": ["--mode", "mono"],
    "mono, fixed intrinsics": ["--mode", "mono", "--fixed-intrinsics"],
    "inertial": ["--mode", "inertial"],
    "inertial, tight": ["--mode", "inertial", "--tight"],
    "stereo": ["--mode", "stereo"],
    "stereo-inertial": ["--mode", "stereo-inertial"],
}


def make_dataset(program, out, frames):
    if not (out / "stadium").exists():
        run(program, "scene", "stadium", out / "stadium")
    camera = out / "camera.yaml"
    camera.write_text((ROOT / "examples/camera-90.yaml").read_text().rstrip() + f"\n  T_cam_imu: {T_CAM_IMU}\n")
    rig = f"cameras:\n  - {{name: left, camera: {camera.name}}}\n  - {{name: right, camera: {camera.name}, position: [0.2, 0, 0]}}"
    flight = (ROOT / "examples/stadium-flight-simulated.yaml").read_text()
    flight = flight.replace("camera: camera-155.yaml", rig).replace("max_frames: 342", f"max_frames: {frames}")
    file = out / "flight.yaml"
    file.write_text(flight + "\nsensors:\n  imu: {preset: adis16448, rate_hz: 200, seed: 1}\n")
    dataset = out / "dataset"
    if not dataset.exists():
        run(program, "render", out / "stadium/twin", "--flight", file, "--out", dataset, "--resolution", "1008,567")
    return dataset


def measure(program, out, dataset, mode):
    odometry, truth = out / "odometry", dataset / "groundtruth.txt"
    cpu_s = run(program, "odometry", dataset, "--out", odometry, "--no-check", "--force", "--quiet", *MODES[mode])
    about = json.loads((odometry / "odometry.json").read_text())
    errors = path_errors(program, odometry, truth, out)
    row = {"mode": mode, "scale": about["scale"], "cpu_s": cpu_s, "frames_tracked": about["frames_tracked"],
           "ate_sim3_share": errors["sim3"]["ate_rmse"] / errors["sim3"]["path_length"]}
    if about["scale"] == "metric":
        row["scale_error"] = errors["sim3"]["scale"] - 1.0
        row["ate_share"] = errors["se3"]["ate_rmse"] / errors["se3"]["path_length"]
    if "sigma_up_deg" in about.get("inertial", {}):
        row["tilt_deg"] = tilt_deg(read_tum(odometry / "trajectory.txt"), read_tum(truth))
        row["sigma_up_deg"] = about["inertial"]["sigma_up_deg"]
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--frames", type=int, default=160)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    dataset = make_dataset(arguments.program, arguments.out, arguments.frames)
    for mode in MODES:
        print(json.dumps(measure(arguments.program, arguments.out, dataset, mode)), flush=True)


if __name__ == "__main__":
    main()
