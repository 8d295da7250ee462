#!/usr/bin/env python3
"""Runs the benchmarks and writes their figures, with machine, commit, and ratios to floors and peers, as a table
(OUT/benchmarks.json and OUT/benchmarks.md).

    benchmarks/run_all.py --build build/release --out out/benchmarks
    benchmarks/run_all.py --build build/release --out out/now --against out/benchmarks/benchmarks.json

With --against, what became worse stands first. Ratios are compared where there are any: they depend little on the
machine and on what else runs on it. TILEFLIGHT_TEST_DATA names a folder of real data, for the benchmarks that use any.
Benchmarks that run other programs (PCL, CloudCompare, COLMAP, Blender) and those of hours are run by hand; see
BENCHMARKS.md.
"""
import argparse
import os
import pathlib
import platform
import subprocess
import sys
import time

import figures

ROOT = pathlib.Path(__file__).resolve().parent.parent


def google(name, floors, accuracy=()):
    """A program of Google Benchmark. Repetitions in turns, so that a busy spell of the machine meets all."""
    def command(options):
        repetitions = 2 if options.quick else 7
        least_s = "0.01" if options.quick else "0.1"
        return [options.bin / name, "--benchmark_format=json", f"--benchmark_repetitions={repetitions}",
                "--benchmark_enable_random_interleaving=true", f"--benchmark_min_time={least_s}"]
    return command, lambda benchmark, text: figures.google_figures(benchmark, text, floors, accuracy)


def data_of(options):
    return options.data if options.data and options.data.is_dir() else None


def odometry(options):
    sequences = ["synthetic"] + (["seven_scenes", "kitti", "machangara"] if data_of(options) and not options.quick else [])
    return [options.bin / "odometry_benchmark", "--runs", "1" if options.quick else "3", *sequences]


def tiles(options):
    tileset = data_of(options) and data_of(options) / "tilesets/machangara_photogrammetry/tileset.json"
    return [options.bin / "tiles_benchmark", tileset] if tileset and tileset.exists() else None


def evaluate(options):
    points = ["--points", "100000"] + ([] if options.quick else ["--points", "1000000"])
    return [options.bin / "evaluate_benchmark", "--place-km2", "0", *points]


def weather(options):
    return [sys.executable, ROOT / "benchmarks/weather_cost.py", options.bin / "tileflight", stadium(options)]


def server(options):
    return [sys.executable, ROOT / "benchmarks/server_benchmark.py", "--binary", options.bin / "tileflight", "--source", stadium(options),
            "--seconds", "1" if options.quick else "4"]


def python_frames(options):
    return [sys.executable, ROOT / "benchmarks/python_frames.py", stadium(options), "--peer", options.bin / "frame_peer"]


def stadium(options):
    """The built-in place, made once."""
    folder = options.out / "stadium"
    if not (folder / "twin/tileset.json").exists():
        subprocess.run([options.bin / "tileflight", "scene", "stadium", folder], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return folder / "twin/tileset.json"


BENCHMARKS = {
    "render": google("render_benchmark", {"FloorWatertight|Beams|RgbAndDepth": "Floor", "Light/.*_.*|Light/[rb].*": "Light/global"}),
    "textures": google("textures_benchmark", {"Pyramid": "Floor"}),
    "voxelize": google("voxelize_benchmark", {r"voxelize/(.*)": r"voxelize_straightforward/\1"}, ["cells"]),
    "nearest_on_mesh": google("nearest_on_mesh_benchmark", {"nearest_on_mesh(_walk)?": "nearest_on_mesh_embree"}),
    "distance": google("distance_benchmark", {}, ["difference_m"]),
    "icp": google("icp_benchmark", {"icp_(to|gen|paper).*": "icp_textbook_to_voxel_centers"}, ["error_m"]),
    "viewer": google("viewer_benchmark", {r"BM_Delivery/(\d+)": r"BM_Copy/\1"}),
    "odometry": (odometry, figures.odometry_figures),
    "evaluate": (evaluate, figures.evaluate_figures),
    "tiles": (tiles, figures.tiles_figures),
    "weather": (weather, figures.weather_figures),
    "server": (server, figures.server_figures),
    "python": (python_frames, figures.python_figures),
}


def first_line(path, start):
    try:
        with open(path, encoding="utf-8") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith(start))
    except (OSError, StopIteration):
        return "unknown"


def describe_machine(options):
    version = subprocess.run([options.bin / "tileflight", "--version"], capture_output=True, text=True, check=True).stdout
    return {
        "program": "; ".join(version.split("\n")[:3]),
        "processor": f"{first_line('/proc/cpuinfo', 'model name')}, {len(os.sched_getaffinity(0))} cores",
        "system": f"{platform.system()} {platform.release()}",
        "load before": f"{os.getloadavg()[0]:.1f}",
        "date": time.strftime("%Y-%m-%d"),
    }


class BenchmarkFailed(Exception):
    """A benchmark ended with an error, or without a figure."""


def run(name, options):
    """The benchmark's figures; none if it lacks data. Raises BenchmarkFailed."""
    command_of, read = BENCHMARKS[name]
    try:
        command = command_of(options)
    except (OSError, subprocess.CalledProcessError) as error:
        raise BenchmarkFailed(f"{name}: {error}") from error
    if command is None:
        print(f"{name}: skipped, its data is not there (TILEFLIGHT_TEST_DATA)", file=sys.stderr)
        return []
    begin = time.monotonic()
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join([str(ROOT / "clients/python"), os.environ.get("PYTHONPATH", "")]))
    if options.data:
        environment["TILEFLIGHT_TEST_DATA"] = str(options.data)
    try:
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True, env=environment, check=False)
    except OSError as error:
        raise BenchmarkFailed(f"{name}: {error}; build it first") from error
    if done.returncode != 0:
        raise BenchmarkFailed(f"{name} ended with {done.returncode}: {done.stderr.strip().splitlines()[-1:] or done.stdout[-200:]}")
    found = read(name, done.stdout)
    if not found:
        raise BenchmarkFailed(f"nothing in {name}'s output is a figure:\n{done.stdout[:500]}")
    print(f"{name}: {len(found)} figures in {time.monotonic() - begin:.0f} s", file=sys.stderr, flush=True)
    return found


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the table")
    parser.add_argument("--data", type=pathlib.Path, default=os.environ.get("TILEFLIGHT_TEST_DATA"))
    parser.add_argument("--only", nargs="+", choices=BENCHMARKS, default=list(BENCHMARKS), metavar="NAME", help=", ".join(BENCHMARKS))
    parser.add_argument("--against", type=pathlib.Path, help="benchmarks.json of another run")
    parser.add_argument("--tolerance", type=float, default=1.1, help="times worse than before that are not named (default 1.1)")
    parser.add_argument("--quick", action="store_true", help="few repetitions: whether it runs, not how fast")
    options = parser.parse_args()
    options.bin = options.build.resolve() / "bin"
    return options


def main():
    options = parse_arguments()
    before = figures.from_json(options.against.read_text(encoding="utf-8"))[1] if options.against else []
    options.out.mkdir(parents=True, exist_ok=True)
    machine = describe_machine(options)
    found, failed, table = [], 0, ""
    for name in options.only:
        try:
            found += run(name, options)
        except BenchmarkFailed as failure:  # the others' figures are still wanted
            print(f"run_all: {failure}", file=sys.stderr, flush=True)
            failed += 1
        # After each, since all of them take long: what there is stays if the run is cut off.
        (options.out / "benchmarks.json").write_text(figures.to_json(machine, found), encoding="utf-8")
        table = figures.to_markdown(machine, found, before, options.tolerance)
        (options.out / "benchmarks.md").write_text(table, encoding="utf-8")
    print(table)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
