"""CPU time of rendering a rig of N cameras, relative to N times one camera's.

Usage: benchmarks/rig_cost.py TILEFLIGHT TILESET [INSTANTS [ROUNDS]]
TILESET is the stadium's (`tileflight scene stadium DIR` writes DIR/twin). Renders the path of examples/stadium-stereo.yaml with 1, 2 and 4 of its left
cameras beside each other (0.3 m apart), on one thread, by turns, so that a busy spell of the machine meets all; the time is the processor time of the
whole program (user and system), of which the least of the rounds is taken: other work can only add to it.
"""
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

EXAMPLE = pathlib.Path(__file__).resolve().parents[1] / "examples"
ORIGIN = "35.310344,-80.740007,190"
COUNTS = [1, 2, 4]


def flight_text(cameras):
    """The example's flight with so many left cameras."""
    text = (EXAMPLE / "stadium-stereo.yaml").read_text(encoding="utf-8")
    before, rest = text.split("cameras:\n", 1)
    after = rest[rest.index("\nfps:") + 1:]
    listed = "".join(f"  - {{name: c{i}, camera: {EXAMPLE}/camera-90.yaml, position: [{0.3 * i}, 0, 0]}}\n" for i in range(cameras))
    return before + "cameras:\n" + listed + after


def cpu_s(command):
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"rig_cost: {' '.join(map(str, command))} failed")
    return usage.ru_utime + usage.ru_stime


def main(tileflight, tileset, instants=10, rounds=5):
    spent = {count: [] for count in COUNTS}
    with tempfile.TemporaryDirectory() as folder:
        for count in COUNTS:
            (pathlib.Path(folder) / f"{count}.yaml").write_text(flight_text(count), encoding="utf-8")
        for _ in range(rounds):
            for count in COUNTS:
                spent[count].append(cpu_s([tileflight, "render", tileset, "--origin", ORIGIN, "--flight", f"{folder}/{count}.yaml", "--out",
                                           f"{folder}/{count}", "--max-frames", str(instants), "--threads", "1", "--force", "--quiet"]))
    one_s = min(spent[1])
    print(f"{instants} instants, processor seconds, least of {rounds} rounds (median)")
    for count in COUNTS:
        least_s = min(spent[count])
        print(f"{count} cameras: {least_s:.2f} s ({statistics.median(spent[count]):.2f}), {least_s / (count * one_s):.3f} of {count} times one")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], *map(int, sys.argv[3:]))
