"""CPU time of each stage with the program's own elementary functions, relative to the C library's, and whether results differ.

Usage: benchmarks/determinism_cost.py BUILD STADIUM [ROUNDS]
BUILD is a folder in which ninja built the program (build/release), STADIUM what `tileflight scene stadium STADIUM` wrote. The program is linked a second time
without core/base/elementary_functions, so that it calls the C library. Both run each stage on one thread, by turns; the time is the processor time of the whole
program (user and system), of which the least of the rounds is taken: other work can only add to it.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

EXAMPLES = pathlib.Path(__file__).resolve().parents[1] / "examples"
ORIGIN = "35.310344,-80.740007,190"


def link_without_own_functions(build, target):
    """Links the program again, with a copy of its archive that lacks the functions."""
    archive = next(build.rglob("libtileflight_base.a"))
    copy = target.parent / archive.name
    shutil.copy(archive, copy)
    subprocess.run(["ar", "d", copy, "elementary_functions.cpp.o"], check=True)
    commands = subprocess.run(["ninja", "-C", build, "-t", "commands", "bin/tileflight"], capture_output=True, text=True, check=True).stdout
    link = commands.splitlines()[-1].replace(str(archive.relative_to(build)), str(copy)).replace("-o bin/tileflight", f"-o {target}")
    subprocess.run(link, shell=True, cwd=build, check=True)


def stages(tileflight, stadium, folder):
    """Name and command of each stage, in the order in which they need each other."""
    def render(name, flight, *options):
        return name, [tileflight, "render", stadium / "twin", "--flight", flight, "--origin", ORIGIN, *options, "--out", folder / name]

    daylight = folder / "daylight.yaml"
    text = (EXAMPLES / "stadium-flight-simulated.yaml").read_text(encoding="utf-8").replace("camera: ", f"camera: {EXAMPLES}/")
    daylight.write_text("light: {model: sun-and-sky, time: 2024-06-21T18:00:00Z}\n", encoding="utf-8")
    lidar = folder / "lidar.yaml"
    lidar.write_text(text + "sensors:\n  lidar: {pattern: raster, columns: 200, rows: 32, horizontal_fov_deg: 90, vertical_fov_deg: 40, rate_hz: 10}\n  imu: {rate_hz: 200}\n",
                     encoding="utf-8")
    small = ["--resolution", "1024,576"]
    aligned, truth = folder / "transform.json", folder / "truth"
    yield "truth (extract)", [tileflight, "extract", stadium / "twin", "--center", "35.310344,-80.740007,205", "--origin", ORIGIN, "--size", "250,250,90",
                              "--voxel", "1", "--out", truth]
    yield render("images", EXAMPLES / "stadium-flight-simulated.yaml", *small, "--max-frames", "100")
    yield render("images, all kinds", EXAMPLES / "stadium-flight-simulated.yaml", *small, "--max-frames", "20", "--outputs", "depth,range,normals,segmentation,flow")
    yield render("images, degraded", EXAMPLES / "stadium-flight-surrogate.yaml", *small, "--max-frames", "20", "--degrade", EXAMPLES / "degrade-dji-o3.yaml")
    yield render("images, sun and sky", EXAMPLES / "stadium-flight-simulated.yaml", *small, "--max-frames", "40", "--degrade", daylight)
    yield render("images, rain", EXAMPLES / "stadium-rain.yaml", "--max-frames", "20")
    yield render("lidar and inertial unit", lidar, *small, "--max-frames", "20")
    yield render("event camera", EXAMPLES / "stadium-events.yaml", "--max-frames", "3")
    yield render("stereo rig", EXAMPLES / "stadium-stereo.yaml", "--max-frames", "40")
    yield "odometry", [tileflight, "odometry", folder / "images", "--out", folder / "odometry"]
    yield "odometry, stereo", [tileflight, "odometry", folder / "stereo rig", "--mode", "stereo", "--out", folder / "stereo"]
    yield "odometry, inertial", [tileflight, "odometry", folder / "stereo rig", "--mode", "inertial", "--out", folder / "inertial"]
    yield "align", [tileflight, "align", folder / "odometry/map.ply", "--to", truth, "--dataset", folder / "images", "--out", aligned]
    yield "evaluate", [tileflight, "evaluate", folder / "odometry", "--truth", truth, "--transform", aligned, "--out", folder / "metrics.json"]


def cpu_s(command):
    process = subprocess.Popen([*command, "--threads", "1", "--quiet"], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"determinism_cost: {' '.join(map(str, command))} failed")
    return usage.ru_utime + usage.ru_stime


def main(build, stadium, rounds):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        link_without_own_functions(build, folder / "tileflight-c-library")
        programs = {"own": build / "bin/tileflight", "C library": folder / "tileflight-c-library"}
        spent = {}
        for turn in range(rounds):
            for program in programs:
                shutil.rmtree(folder / program, ignore_errors=True)
                (folder / program).mkdir()
            for both in zip(*(stages(tileflight, stadium, folder / program) for program, tileflight in programs.items())):
                order = list(zip(programs, both))
                for program, (stage, command) in order if turn % 2 == 0 else order[::-1]:
                    spent.setdefault(stage, {}).setdefault(program, []).append(cpu_s(command))
        print(f"{'stage':28s}   own functions   C library   ratio")
        for stage, times in spent.items():
            own, c_library = min(times["own"]), min(times["C library"])
            print(f"{stage:28s} {own:13.2f} s {c_library:9.2f} s {own / c_library:7.3f}")


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve(), int(sys.argv[3]) if len(sys.argv) == 4 else 3)
