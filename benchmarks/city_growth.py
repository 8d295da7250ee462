#!/usr/bin/env python3
"""What commands take on synthetic cities of N x N copies of a tileset (make_city.py): processor time, wall-clock time,
peak memory and bytes written, a line a run, as a Markdown table and as JSON.

    city_growth.py build/release/bin/tileflight /tmp/growth --copies 1 2 4 8
    city_growth.py build/release/bin/tileflight /tmp/growth --copies 4 --commands render --links

The flight crosses each city from corner to corner, 20 frames, 30 degrees down, 155 degrees wide. Results are removed
after each run, the cities stay.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

HALF_X_M, HALF_Y_M = 302.1, 203.2  # of a copy of Machangara
HEIGHT_M = 110.0

CAMERA = """cam0:
  camera_model: pinhole
  intrinsics: [248.404928, 248.404928, 335.5, 188.5]
  distortion_model: equidistant
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [672, 378]
"""


def flight(copies):
    x, y = 0.8 * copies * HALF_X_M, 0.8 * copies * HALF_Y_M
    speed = 2 * (x * x + y * y) ** 0.5 / 19
    return (f"camera: camera.yaml\nfps: 1\nmax_frames: 20\nspeed_m_s: {speed:.3f}\nacceleration_m_s2: 1000\n"
            f"waypoints:\n"
            f"  - {{position: [{-x:.1f}, {-y:.1f}, {HEIGHT_M}], yaw_deg: 56, pitch_deg: -30}}\n"
            f"  - {{position: [{x:.1f}, {y:.1f}, {HEIGHT_M}], yaw_deg: 56, pitch_deg: -30}}\n")


def bytes_below(path):
    return sum(f.stat().st_size for f in path.rglob("*") if f.is_file()) if path.exists() else 0


def run(words, out):
    """Runs a command; {seconds, cpu_seconds, memory_mb, bytes_mb, exit, message}."""
    shutil.rmtree(out, ignore_errors=True)
    started = time.monotonic()
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    messages = process.stderr.read().strip().splitlines()
    _, status, usage = os.wait4(process.pid, 0)
    result = {"seconds": round(time.monotonic() - started, 1), "cpu_seconds": round(usage.ru_utime + usage.ru_stime, 1),
              "memory_mb": round(usage.ru_maxrss / 1000), "bytes_mb": round(bytes_below(out) / 1e6),
              "exit": os.waitstatus_to_exitcode(status), "message": messages[-1] if messages else ""}
    shutil.rmtree(out, ignore_errors=True)
    return result


def commands(count, city, arguments):
    program, work = arguments.program, arguments.work
    source, flight_file = str(city / "tileset.json"), str(city / "flight.yaml")
    out = ["--out", str(work / "out"), "--quiet"]
    memory = ["--memory", str(arguments.memory)]
    size = [2 * count * HALF_X_M, 2 * count * HALF_Y_M, 80]
    region = ["--center-local", "0,0,19", "--size", ",".join(str(round(s, 1)) for s in size)]
    return {
        "inspect": [program, "inspect", source],
        "extract": [program, "extract", source, *region, "--voxel", "1", "--block", str(arguments.block), *out],
        "extract-whole": [program, "extract", source, *region, "--voxel", "1", *out],
        "coverage": [program, "coverage", source, "--flight", flight_file, *region, "--frames", "20", "--width", "160",
                     *memory, *out],
        "render": [program, "render", source, "--flight", flight_file, "--pixel-error", str(arguments.pixel_error),
                   *memory, *out],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("work", type=pathlib.Path, help="folder for cities and results")
    parser.add_argument("--copies", type=int, nargs="+", default=[1, 2, 4, 8], help="copies along each axis")
    parser.add_argument("--commands", nargs="+", default=["inspect", "extract", "coverage", "render"])
    parser.add_argument("--links", action="store_true", help="each copy's files are different ones (make_city.py)")
    parser.add_argument("--block", type=float, default=250, help="metres")
    parser.add_argument("--memory", type=float, default=1, help="GB, of coverage and render")
    parser.add_argument("--pixel-error", type=float, default=16, help="of render")
    arguments = parser.parse_args()
    columns = ["command", "copies", "cpu_seconds", "seconds", "memory_mb", "bytes_mb"]
    print("| " + " | ".join(columns) + " |\n" + "| --- " * len(columns) + "|")
    rows = []
    for count in arguments.copies:
        city = arguments.work / (f"city{count * count}" + ("links" if arguments.links else ""))
        maker = pathlib.Path(__file__).with_name("make_city.py")
        links = ["--links"] if arguments.links else []
        subprocess.run([sys.executable, str(maker), str(count), str(city), *links], check=True)
        (city / "camera.yaml").write_text(CAMERA)
        (city / "flight.yaml").write_text(flight(count))
        words = commands(count, city, arguments)
        for name in arguments.commands:
            row = {"command": name, "copies": count * count}
            row |= run(words[name], arguments.work / "out")
            rows.append(row)
            failure = "" if row["exit"] == 0 else f" exit {row['exit']}: {row['message']}"
            print("| " + " | ".join(str(row[column]) for column in columns) + " |" + failure, flush=True)
    (arguments.work / "growth.json").write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
