"""Hand-held real pictures: ATE of our odometry and of an outside system over excerpts of datasets, there and back, thinned out.

    python3 benchmarks/handheld_accuracy.py build/release/bin/tileflight DATASET... --out DIR [--system dso --seeds 3]
    python3 benchmarks/handheld_accuracy.py … --words --loop-closure        # further words to our `odometry`

A dataset has images, times.txt, a calibration and groundtruth.txt. Each variant becomes a dataset of links, once. Errors are of the path
after alignment by a similarity. An outside system runs once a seed; its error is the geometric mean. Intervals are Student's t on the
logarithms of ratios: variants share pictures, so they are narrower than those of as many separate recordings would be.
"""

import argparse
import json
import math
import os
import pathlib
import shutil
import statistics
import subprocess

# Name, first and end picture as shares of the sequence, step, reversed.
VARIANTS = [
    ("whole", 0.0, 1.0, 1, False), ("whole-back", 0.0, 1.0, 1, True),
    ("whole-every2", 0.0, 1.0, 2, False), ("whole-every2-back", 0.0, 1.0, 2, True),
    ("first-half", 0.0, 0.5, 1, False), ("first-half-back", 0.0, 0.5, 1, True),
    ("middle", 0.25, 0.75, 1, False), ("middle-back", 0.25, 0.75, 1, True),
    ("second-half", 0.5, 1.0, 1, False), ("second-half-back", 0.5, 1.0, 1, True),
    ("from-fifth", 0.2, 1.0, 1, False), ("to-four-fifths-back", 0.0, 0.8, 1, True),
]
T_95 = {2: 12.71, 3: 4.30, 4: 3.18, 5: 2.78, 6: 2.57, 7: 2.45, 8: 2.36, 9: 2.31, 10: 2.26, 11: 2.23, 12: 2.20, 24: 2.07}


def rows_of(file):
    return [line.split() for line in file.read_text().splitlines() if line and not line.startswith("#")]


def link_variant(dataset, variant, out):
    """A dataset of the variant's pictures in its order, at times that increase."""
    name, first, end, step, back = variant
    folder = out / f"{dataset.name}-{name}"
    if folder.exists():
        return folder
    times = rows_of(dataset / "times.txt")
    poses = {f"{float(row[0]):.6f}": row[1:] for row in rows_of(dataset / "groundtruth.txt")}
    files = sorted((dataset / "images").iterdir())
    chosen = list(range(round(first * len(times)), round(end * len(times)), step))
    if back:
        chosen.reverse()
    (folder / "images").mkdir(parents=True)
    lines, truth = [], []
    for k, i in enumerate(chosen):
        os.symlink(files[i].resolve(), folder / "images" / f"{k:06d}{files[i].suffix}")
        time = abs(float(times[i][1]) - float(times[chosen[0]][1]))
        lines.append(f"{k:06d} {time:.6f} {times[i][2] if len(times[i]) > 2 else 0}")
        pose = poses.get(f"{float(times[i][1]):.6f}")
        if pose:
            truth.append(" ".join([f"{time:.6f}", *pose]))
    (folder / "times.txt").write_text("\n".join(lines) + "\n")
    (folder / "groundtruth.txt").write_text("\n".join(truth) + "\n")
    for name in ("camera.yaml", "camera.txt", "pcalib.txt", "vignette.png"):
        if (dataset / name).exists():
            shutil.copy(dataset / name, folder / name)
    return folder


def run(program, *words):
    return subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=False)


def score(program, dataset, folder, out):
    """ATE and share of the pictures with a pose; None without a path."""
    trajectory, metrics = folder / "trajectory.txt", out / "metrics.json"
    if not trajectory.exists() or len(rows_of(trajectory)) < 3:
        return None
    done = run(program, "evaluate", "--trajectory", trajectory, "--truth-trajectory", dataset / "groundtruth.txt", "--alignment", "sim3",
               "--out", metrics, "--force", "--quiet")
    if done.returncode:
        raise SystemExit(done.stderr)
    found = json.loads(metrics.read_text())["trajectory"]
    return {"ate_m": found["ate_rmse"], "path_m": found["path_length"],
            "tracked": len(rows_of(trajectory)) / len(rows_of(dataset / "times.txt"))}


def track(program, dataset, out, words, name, again=True):
    folder = out / "odometry" / f"{dataset.name}-{name}"
    folder.parent.mkdir(exist_ok=True)
    if not again and (folder / "odometry.json").exists():
        return score(program, dataset, folder, out)
    shutil.rmtree(folder, ignore_errors=True)
    done = run(program, "odometry", dataset, "--out", folder, "--force", "--quiet", *words)
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr)
    return score(program, dataset, folder, out)


def measure(program, dataset, out, arguments):
    ours = track(program, dataset, out, ["--no-check", *arguments.words], "ours")
    theirs = []
    for seed in range(1, arguments.seeds + 1) if arguments.system else ():
        theirs.append(track(program, dataset, out, ["--system", arguments.system, "--seed", seed], f"{arguments.system}-{seed}",
                            again=False))
    return {"ours": ours, "theirs": theirs}


def geometric_mean(values):
    return math.exp(statistics.fmean(map(math.log, values)))


def interval(ratios):
    """Geometric mean of ratios and its 95 % interval."""
    logs = [math.log(ratio) for ratio in ratios]
    mean = statistics.fmean(logs)
    half = T_95.get(len(logs), 2.0 if len(logs) > 24 else 2.2) * statistics.stdev(logs) / math.sqrt(len(logs)) if len(logs) > 1 else math.inf
    return tuple(math.exp(value) for value in (mean, mean - half, mean + half))


def errors_of(row):
    return [run["ate_m"] for run in row["theirs"] if run and run["tracked"] > 0.5]


def describe(rows, system):
    print(f"\n{'variant':40s} path m  tracked    ours m" + (f"   {system} m (least to largest, runs)   ratio" if system else ""))
    for name, row in rows.items():
        ours, theirs = row["ours"], errors_of(row)
        line = f"{name:40s} {ours['path_m']:6.2f} {100 * ours['tracked']:6.0f} % {ours['ate_m']:9.4f}" if ours else f"{name:40s} no path"
        if theirs:
            line += f"   {geometric_mean(theirs):.4f} ({min(theirs):.4f} to {max(theirs):.4f}, {len(theirs)} of {len(row['theirs'])})"
            line += f"   {ours['ate_m'] / geometric_mean(theirs):.2f}" if ours else ""
        print(line)
    found = [row["ours"]["ate_m"] for row in rows.values() if row["ours"]]
    print(f"ours: geometric mean {geometric_mean(found):.4f} m, {min(found):.4f} to {max(found):.4f}, {len(found)} of {len(rows)} variants")
    both = [row["ours"]["ate_m"] / geometric_mean(errors_of(row)) for row in rows.values() if row["ours"] and errors_of(row)]
    if len(both) > 1:
        mean, low, high = interval(both)
        print(f"ours over {system}, {len(both)} variants: {mean:.2f} (95 %: {low:.2f} to {high:.2f}), {sum(r < 1 for r in both)} better")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("datasets", nargs="+", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--only", nargs="+", default=[""], help="variants with one of these parts in their names")
    parser.add_argument("--without", nargs="+", default=[], help="and none of these")
    parser.add_argument("--system", help="an outside system, by its adapter's name")
    parser.add_argument("--seeds", type=int, default=3, help="runs of the outside system")
    parser.add_argument("--words", nargs=argparse.REMAINDER, default=[], help="the rest goes to our `odometry`")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    rows = {}
    for dataset in arguments.datasets:
        for variant in VARIANTS:
            name = f"{dataset.name}-{variant[0]}"
            if not any(part in name for part in arguments.only) or any(part in name for part in arguments.without):
                continue
            folder = link_variant(dataset.resolve(), variant, arguments.out)
            rows[name] = measure(arguments.program, folder, arguments.out, arguments)
            print(json.dumps({"variant": name, **rows[name]}), flush=True)
    describe(rows, arguments.system)


if __name__ == "__main__":
    main()
