"""Errors of `tileflight localize` over the flights of a proving ground, by the true poses, which the program does not use.

Usage: benchmarks/localize_accuracy.py PROGRAM PROVING_GROUND OUT [MOST]
PROGRAM is build/release/bin/tileflight, PROVING_GROUND a folder that `proving_ground --out` wrote (places/, flights/). Of at most MOST flights, OUT gets what
`localize` writes. Flights without aids (`nothing` in their name) are searched in the whole place. The table has, by place, lens and height, the medians over
the flights of each flight's median and 95 % error of position and rotation, and of its mean squared position error over the squared sigma.
"""
import csv
import json
import math
import pathlib
import re
import statistics
import subprocess
import sys

NAME = re.compile(r"\d+-(?P<place>.+)-(straight|arc|orbit|lawnmower|hover-and-turn|climb)-(?P<lens>\d+)-(nadir|oblique|shallow)-(?P<height>\d+)m-(?P<aids>\w+)")


def read_poses(file):
    poses = {}
    for line in file.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            values = [float(word) for word in line.split()]
            poses[round(values[0], 4)] = values[1:]
    return poses


def rotation_deg(a, b):
    """The angle between two unit quaternions."""
    return math.degrees(2.0 * math.acos(min(1.0, abs(sum(x * y for x, y in zip(a[3:], b[3:]))))))


def score(located, truth):
    """Figures of one flight."""
    poses, true_poses = read_poses(located / "trajectory.txt"), read_poses(truth)
    with open(located / "quality.csv", encoding="utf-8", newline="") as file:
        quality = {round(float(row["time_s"]), 4): row for row in csv.DictReader(file)}
    position, rotation, ratios = [], [], []
    for time, pose in poses.items():
        position.append(math.dist(pose[:3], true_poses[time][:3]))
        rotation.append(rotation_deg(pose, true_poses[time]))
        ratios.append((position[-1] / float(quality[time]["sigma_position_m"])) ** 2)
    about = json.loads((located / "localize.json").read_text(encoding="utf-8"))
    return {"images": len(true_poses), "with pose": len(poses), "located": about["located"], "median m": statistics.median(position), "95 % m": quantile(position),
            "median deg": statistics.median(rotation), "95 % deg": quantile(rotation), "ratio": statistics.mean(ratios), "images/s": about["images_per_second"],
            "warned": any(warning["severity"] != "note" for warning in about["warnings"]), "position": position, "rotation": rotation}


def quantile(values, share=0.95):
    return sorted(values)[int(share * (len(values) - 1))]


def line(group, flights):
    def median(key):
        return statistics.median(flight[key] for flight in flights)
    with_pose, images = sum(f["with pose"] for f in flights), sum(f["images"] for f in flights)
    return (f"| {group} | {len(flights)} | {100 * with_pose / images:.1f} | {median('median m'):.3f} | {median('95 % m'):.3f} | {median('median deg'):.3f} | "
            f"{median('95 % deg'):.3f} | {median('ratio'):.2f} | {median('images/s'):.0f} |")


def main(program, ground, out, most):
    results, failed = [], []
    for folder in sorted((ground / "flights").iterdir())[:most]:
        match = NAME.match(folder.name)
        if not match or not (folder / "odometry/trajectory.txt").exists():
            continue
        located = out / folder.name
        command = [program, "localize", folder / "dataset", "--to", ground / "places" / match["place"], "--odometry", folder / "odometry", "--out", located, "--force", "--quiet"]
        if match["aids"] == "nothing":
            command.append("--search")
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        if run.returncode != 0:
            failed.append(f"{folder.name}: {run.stderr.strip()}")
            continue
        flight = score(located, folder / "dataset/groundtruth.txt")
        height = int(match["height"])
        flight["groups"] = ["**all**", "over " + match["place"], match["lens"] + "° lens", "below 12 m" if height < 12 else "12 to 30 m" if height < 30 else "30 m and above"]
        results.append(flight)
        print(f"{folder.name}: {flight['with pose']}/{flight['images']} images, {flight['median m']:.3f} m, 95 % {flight['95 % m']:.3f} m, {flight['median deg']:.3f} deg, "
              f"squared error over squared sigma {flight['ratio']:.2f}{', warned' if flight['warned'] else ''}", file=sys.stderr)
    if not results:
        sys.exit("localize_accuracy: no flight was located")
    print("| | flights | images with a pose, % | median, m | 95 %, m | median, ° | 95 %, ° | squared error over squared sigma | images/s |\n| --- |" + " --- |" * 8)
    groups = dict.fromkeys(group for flight in results for group in flight["groups"])
    for group in sorted(groups, key=lambda name: (name != "**all**", name)):
        print(line(group, [flight for flight in results if group in flight["groups"]]))
    position, rotation = [p for f in results for p in f["position"]], [r for f in results for r in f["rotation"]]
    calibrated = sum(0.5 <= flight["ratio"] <= 2.0 for flight in results)
    print(f"\nAll images: median {statistics.median(position):.3f} m and {statistics.median(rotation):.3f} degrees, 95 % within {quantile(position):.3f} m and "
          f"{quantile(rotation):.3f} degrees. Squared error over squared sigma within 0.5 to 2 in {calibrated} of {len(results)} flights. Warned: "
          f"{sum(flight['warned'] for flight in results)} of {len(results)}.")
    for text in failed:
        print("- not located: " + text)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    main(sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3]), int(sys.argv[4]) if len(sys.argv) == 5 else None)
