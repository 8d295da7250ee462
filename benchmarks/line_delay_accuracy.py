"""A rolling shutter's line delay from the images alone: rendered flights whose row time is withheld from the odometry.

    python3 benchmarks/line_delay_accuracy.py build/release/bin/tileflight --out /tmp/delays [--only PART-OF-A-NAME...]

The flights are those of loop_accuracy.py, rendered once. Each is tracked with the true delay, without one, and with
`--estimate-line-delay`; errors are of the path after alignment by a similarity.
"""

import argparse
import json
import math
import pathlib
import re
import shutil
import statistics

import loop_accuracy

# Flight over the stadium, field of view, delay in microseconds a row, seed.
VARIANTS = [("return", 90, 0, 1), ("return", 155, 30, 2), ("orbit", 90, 10, 3), ("orbit", 155, -20, 4), ("square", 90, 30, 5),
            ("square", 155, 0, 6), ("eight", 90, -20, 7), ("eight", 155, 10, 8)]


def render(program, out, source, variant, size):
    """The dataset, and the same without the row time in its calibration."""
    flight, fov, delay, seed = variant
    name = f"{flight}-{fov}-{delay}us"
    folder, withheld = out / name, out / f"{name}-withheld"
    if not folder.exists():
        file = loop_accuracy.write_flight(out, ("stadium", flight, fov, False, seed))
        degrade = out / "degrade.yaml"
        degrade.write_text(f"line_delay: {delay * 1e-6:.9f}\nwhite_electrons: 8000\nread_noise_electrons: 8\n")
        done = loop_accuracy.run(program, "render", *source, "--flight", file, "--out", folder, "--resolution", size, "--seed", seed,
                                 "--degrade", degrade)
        if done.returncode:
            raise SystemExit(f"{folder}: {done.stderr}")
    shutil.rmtree(withheld, ignore_errors=True)
    withheld.mkdir()
    for entry in folder.iterdir():
        if entry.name != "camera.yaml":
            (withheld / entry.name).symlink_to(entry.resolve())
    calibration = (folder / "camera.yaml").read_text()
    (withheld / "camera.yaml").write_text(re.sub(r"(?m)^\s*line_delay:.*\n", "", calibration))
    return folder, withheld


def measure(program, out, folders, delay):
    folder, withheld = folders
    _, known, _ = loop_accuracy.track(program, out, folder, ["--no-check"])
    _, without, _ = loop_accuracy.track(program, out, withheld, ["--no-check"])
    about, found, _ = loop_accuracy.track(program, out, withheld, ["--no-check", "--estimate-line-delay"])
    estimate = about["line_delay"]
    return {"true_us": delay, "estimate_us": 1e6 * estimate["estimate_s"], "sigma_us": 1e6 * estimate["sigma_s"],
            "used_us": 1e6 * estimate["used_s"], "passes": estimate["passes"], "ate_known_m": known["ate_rmse"],
            "ate_without_m": without["ate_rmse"], "ate_estimated_m": found["ate_rmse"]}


def describe(rows):
    print(f"\n{'flight':20s} true us  estimate   sigma   off/sigma  passes   ATE m: known  without  estimated")
    for name, row in rows.items():
        off = (row["estimate_us"] - row["true_us"]) / row["sigma_us"]
        print(f"{name:20s} {row['true_us']:7d} {row['estimate_us']:9.2f} {row['sigma_us']:7.2f} {off:11.2f} {row['passes']:7d} "
              f"{row['ate_known_m']:14.4f} {row['ate_without_m']:8.4f} {row['ate_estimated_m']:10.4f}")
    squares = [((row["estimate_us"] - row["true_us"]) / row["sigma_us"]) ** 2 for row in rows.values()]
    ratios = [math.log(row["ate_estimated_m"] / row["ate_known_m"]) for row in rows.values()]
    print(f"error over its sigma: root mean square {math.sqrt(statistics.fmean(squares)):.2f}; ATE with the estimate over that with "
          f"the true delay: geometric mean {math.exp(statistics.fmean(ratios)):.3f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--only", nargs="+", default=[""], help="variants with one of these parts in their names")
    parser.add_argument("--size", default="512,288", help="of the images, pixels")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    source = loop_accuracy.sources(arguments.program, arguments.out)["stadium"]
    rows = {}
    for variant in VARIANTS:
        name = f"{variant[0]}-{variant[1]}-{variant[2]}us"
        if not any(part in name for part in arguments.only):
            continue
        folders = render(arguments.program, arguments.out, source, variant, arguments.size)
        rows[name] = measure(arguments.program, arguments.out, folders, variant[2])
        print(json.dumps({"variant": name, **rows[name]}), flush=True)
    describe(rows)


if __name__ == "__main__":
    main()
