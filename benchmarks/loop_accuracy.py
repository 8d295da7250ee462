"""What loop closure does to paths that return: ATE without and with it, over places, flights, lenses and cameras.

    python3 benchmarks/loop_accuracy.py build/release/bin/tileflight --out /tmp/loops [--only PART-OF-A-NAME...]
    python3 benchmarks/loop_accuracy.py … --words --no-check      # further words to `odometry`

Every variant is rendered once; a second run only tracks. Errors are of the path after alignment by a similarity.
"""

import argparse
import cmath
import json
import math
import os
import pathlib
import statistics
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent
FPS = 10.0
# Middle of the flights, height of what is below, radius that flights keep to, height over it, pitch in degrees.
PLACES = {"stadium": ((0.0, 0.0), 0.0, 34.0, 24.0, -52.0), "machangara": ((300.0, -140.0), 2885.0, 34.0, 32.0, -48.0),
          "paphos": ((-13.0, -58.0), 0.0, 37.0, 16.0, -36.0)}
DEGRADED = """white_electrons: 4000
read_noise_electrons: 12
vignetting: 0.3
exposure_drift: 0.15
exposure_time: 0.008
exposure_samples: 3
"""
FRAMES = {"return": 240, "wing": 240, "orbit": 260, "lawnmower": 470, "square": 280, "eight": 240}
# Place, flight, field of view, degraded, seed.
VARIANTS = [
    ("machangara", "return", 90, False, 1), ("machangara", "return", 155, True, 2), ("machangara", "orbit", 90, True, 3),
    ("machangara", "orbit", 155, False, 4), ("machangara", "lawnmower", 90, False, 5),
    ("machangara", "lawnmower", 155, True, 6), ("machangara", "square", 90, True, 7),
    ("machangara", "eight", 155, False, 8), ("stadium", "return", 90, True, 9), ("stadium", "return", 155, False, 10),
    ("stadium", "orbit", 90, False, 11), ("stadium", "orbit", 155, True, 12), ("stadium", "lawnmower", 90, True, 13),
    ("stadium", "square", 90, False, 14), ("stadium", "square", 155, True, 15), ("stadium", "eight", 90, True, 16),
    ("paphos", "wing", 90, False, 17), ("paphos", "wing", 155, True, 18), ("paphos", "wing", 90, True, 19),
]


def name_of(variant):
    place, flight, fov, degraded, seed = variant
    return f"{place}-{flight}-{fov}-{'degraded' if degraded else 'clean'}-{seed}"


def run(program, *words):
    done = subprocess.run([program, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr)
    return done


def sources(program, out):
    data = pathlib.Path(os.environ.get("TILEFLIGHT_TEST_DATA", ROOT / "../../shared/data")) / "tilesets"
    if not (out / "stadium").exists():
        run(program, "scene", "stadium", out / "stadium")
    found = {"stadium": [out / "stadium/twin", "--origin", "35.310344,-80.740007,190"]}
    for place, folder, origin in (("machangara", "machangara_photogrammetry", "-0.24,-78.52,0"),
                                  ("paphos", "paphos_agora_meshopt", "34.760089,32.407932,39.3")):
        if (data / folder).exists():
            found[place] = [data / folder / "tileset.json", "--origin", origin]
    return found


# ---- flights: a share of the flight to east and north (in radii) and heading (degrees right of north) ----

def on_corners(corners, share):
    """A point of a closed polygon's circumference and the side's number."""
    sides = len(corners)
    whole = share * sides
    side = min(int(whole), sides - 1)
    part = whole - side
    a, b = corners[side % sides], corners[(side + 1) % sides]
    return (a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])), side


def there_and_back(share):
    along = 1.0 - abs(2.0 * share - 1.0)
    return along * 2.0 - 1.0, 0.35 * math.sin(2.5 * along), 65.0 + 20.0 * math.sin(2.0 * along)


def wing(share):
    """There and back along a building, which the camera looks along."""
    along = 1.0 - abs(2.0 * share - 1.0)
    return along * 2.0 - 1.0, 0.04 * math.sin(7.0 * along), 78.0 + 8.0 * math.sin(5.0 * along)


def orbit(share):
    """Two rounds, towards the middle."""
    angle = 2.0 * math.tau * share
    return math.sin(angle), math.cos(angle), math.degrees(angle) + 180.0


def line(a, b):
    """Length of a piece of a path, and its point at a part of it (east + north i)."""
    return abs(b - a), lambda part: a + part * (b - a)


def arc(middle, start, turned):
    """The same, of a circle: angle at which it begins and angle that it goes on to the left, radians."""
    return TURN * abs(turned), lambda part: middle + TURN * cmath.exp(1j * (start + part * turned))


REACH, TURN, HALF = 0.65, 0.325, math.pi  # half the length of a line, radius of a turn, half a circle
LAWNMOWER = [line(-REACH - REACH * 1j, REACH - REACH * 1j), arc(REACH - TURN * 1j, -HALF / 2, HALF), line(REACH, -REACH),
             arc(-REACH + TURN * 1j, -HALF / 2, -HALF), line(-REACH + REACH * 1j, TURN + REACH * 1j),
             arc(TURN + TURN * 1j, HALF / 2, -HALF / 2), line(REACH + TURN * 1j, REACH - REACH * 1j),
             arc(TURN - REACH * 1j, 0.0, -HALF), line(-REACH * 1j, REACH * 1j), arc(-TURN + REACH * 1j, 0.0, HALF),
             line(-REACH + REACH * 1j, -REACH - REACH * 1j)]


def lawnmower(share):
    """Three lines to and fro to the east, then three to the north over the same ground, at one speed with half circles between
    them; the camera keeps its heading."""
    along = share * sum(length for length, _ in LAWNMOWER)
    for length, point in LAWNMOWER[:-1]:
        if along <= length:
            break
        along -= length
    else:
        length, point = LAWNMOWER[-1]
    where = point(min(along / length, 1.0))
    return where.real, where.imag, 20.0


def square(share):
    """Two rounds; the camera looks along the sides and turns at the corners."""
    corners = [(-1, -1), (-1, 1), (1, 1), (1, -1)]
    (east, north), side = on_corners(corners, 2.0 * share % 1.0)
    return 0.8 * east, 0.8 * north, 90.0 * side


def eight(share):
    """One and a half rounds of a figure of eight; the camera keeps its heading."""
    angle = 1.5 * math.tau * share
    return math.sin(angle), math.sin(2.0 * angle) / 1.4, -30.0


FLIGHTS = {"return": there_and_back, "wing": wing, "orbit": orbit, "lawnmower": lawnmower, "square": square, "eight": eight}


def smoothed(values, half):
    """Mean over a window, so that a vehicle could fly it."""
    return [statistics.fmean(values[max(0, i - min(half, i, len(values) - 1 - i)):i + min(half, i, len(values) - 1 - i) + 1])
            for i in range(len(values))]


def unwrapped(degrees):
    out = [degrees[0]]
    for angle in degrees[1:]:
        out.append(out[-1] + (angle - out[-1] + 180.0) % 360.0 - 180.0)
    return out


def quaternion(heading_deg, pitch_deg):
    """x, y, z, w of T_local_camera: camera x right, y down, z forward; local frame east, north, up."""
    h, p = math.radians(heading_deg), math.radians(pitch_deg)
    z = (math.sin(h) * math.cos(p), math.cos(h) * math.cos(p), math.sin(p))
    x = (math.cos(h), -math.sin(h), 0.0)
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    m = [[x[i], y[i], z[i]] for i in range(3)]
    # The largest of the four squares decides which root is safe.
    squares = [1 + m[0][0] - m[1][1] - m[2][2], 1 - m[0][0] + m[1][1] - m[2][2], 1 - m[0][0] - m[1][1] + m[2][2],
               1 + m[0][0] + m[1][1] + m[2][2]]
    k = max(range(4), key=squares.__getitem__)
    s = 2.0 * math.sqrt(squares[k])
    if k == 3:
        q = [(m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s, s / 4]
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q = [0.0] * 4
        q[k], q[i], q[j] = s / 4, (m[i][k] + m[k][i]) / s, (m[j][k] + m[k][j]) / s
        q[3] = (m[j][i] - m[i][j]) / s
    return q


def write_flight(out, variant):
    """Poses with a sway that differs by seed and between the rounds."""
    place, flight, fov, _, seed = variant
    (east, north), ground, radius, height, pitch = PLACES[place]
    count = FRAMES[flight]
    rows = [FLIGHTS[flight](i / (count - 1)) for i in range(count)]
    x, y = (smoothed([row[k] for row in rows], 5) for k in (0, 1))
    heading = smoothed(unwrapped([row[2] for row in rows]), 8)
    lines = []
    for i in range(count):
        phase = seed + 9.0 * i / count
        sway = [math.sin(phase * k + seed) for k in (1.3, 1.9, 1.1, 1.7)]
        position = (east + radius * x[i] + 0.03 * height * sway[0], north + radius * y[i] + 0.03 * height * sway[1],
                    ground + height * (1.0 + 0.05 * sway[2]))
        q = quaternion(heading[i] + 3.0 * sway[3], pitch + 3.0 * sway[0])
        lines.append(" ".join(f"{value:.9f}" for value in (i / FPS, *position, *q)))
    path = out / f"{name_of(variant)}.txt"
    path.write_text("\n".join(lines) + "\n")
    file = out / f"{name_of(variant)}.yaml"
    file.write_text(f"camera: {ROOT}/examples/camera-{fov}.yaml\ntrajectory: {path}\n")
    return file


def render(program, out, source, variant, size):
    folder = out / name_of(variant)
    if not folder.exists():
        words = ["render", *source, "--flight", write_flight(out, variant), "--out", folder, "--resolution", size,
                 "--seed", variant[4]]
        if variant[3]:
            (out / "degraded.yaml").write_text(DEGRADED)
            words += ["--degrade", out / "degraded.yaml"]
        done = run(program, *words)
        if done.returncode:
            raise SystemExit(f"{folder}: {done.stderr}")
    return folder


def track(program, out, dataset, words):
    folder = out / "odometry" / f"{dataset.name}{'-loops' if '--loop-closure' in words else ''}"
    folder.parent.mkdir(exist_ok=True)
    run(program, "odometry", dataset, "--out", folder, "--force", "--quiet", *words)
    about = json.loads((folder / "odometry.json").read_text())
    metrics = out / "metrics.json"
    run(program, "evaluate", "--trajectory", folder / "trajectory.txt", "--truth-trajectory", dataset / "groundtruth.txt",
        "--alignment", "sim3", "--out", metrics, "--force", "--quiet")
    return about, json.loads(metrics.read_text())["trajectory"], (folder / "trajectory.txt").read_bytes()


def measure(program, out, dataset, words):
    plain, error, path = track(program, out, dataset, words)
    closed, closed_error, closed_path = track(program, out, dataset, [*words, "--loop-closure"])
    loops = closed["loops"]
    return {"frames_tracked": plain["frames_tracked"], "path_m": error["path_length"], "ate_m": error["ate_rmse"],
            "ate_closed_m": closed_error["ate_rmse"], "ratio": closed_error["ate_rmse"] / error["ate_rmse"],
            "loops": len(loops), "unchanged": path == closed_path}


def describe(rows):
    print(f"\n{'variant':44s} tracked   path m    ATE m  with it    ratio   loops")
    for name, row in rows.items():
        print(f"{name:44s} {row['frames_tracked']:7d} {row['path_m']:8.1f} {row['ate_m']:8.4f} {row['ate_closed_m']:8.4f} "
              f"{row['ratio']:8.3f} {row['loops']:7d}{'  same path' if row['unchanged'] else ''}")
    ratios = sorted(row["ratio"] for row in rows.values())
    mean = math.exp(statistics.fmean(math.log(ratio) for ratio in ratios))
    print(f"ATE with loop closure over that without, {len(ratios)} variants: geometric mean {mean:.3f}, least {ratios[0]:.3f}, "
          f"median {statistics.median(ratios):.3f}, largest {ratios[-1]:.3f}; "
          f"sums {sum(row['ate_m'] for row in rows.values()):.4f} and {sum(row['ate_closed_m'] for row in rows.values()):.4f} m")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--only", nargs="+", default=[""], help="variants with one of these parts in their names")
    parser.add_argument("--size", default="512,288", help="of the images, pixels")
    parser.add_argument("--words", nargs=argparse.REMAINDER, default=[], help="the rest goes to `odometry`")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    found = sources(arguments.program, arguments.out)
    rows = {}
    for variant in VARIANTS:
        name = name_of(variant)
        if variant[0] not in found or not any(part in name for part in arguments.only):
            continue
        dataset = render(arguments.program, arguments.out, found[variant[0]], variant, arguments.size)
        rows[name] = measure(arguments.program, arguments.out, dataset, arguments.words)
        print(json.dumps({"variant": name, **rows[name]}), flush=True)
    describe(rows)


if __name__ == "__main__":
    main()
