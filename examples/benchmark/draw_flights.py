#!/usr/bin/env python3
"""Draws flights at random over places, and writes an experiment for each and a study of all.

  draw_flights.py OUT [--places FILE] [--flights N] [--seed N] [--program tileflight]

FILE lists places, one a line: NAME SOURCE SECOND LATITUDE LONGITUDE HEIGHT EAST NORTH UP, where SOURCE is a tileset, SECOND the tileset that the
second flight films (another season or a finer model; the same where there is none), then the origin of the local frame and the size of the
region about it in metres. Without FILE: the six kinds of built-in places.

A draw has a kind, lens, height, view and speed of its own. It is kept where `tileflight preview` finds it clear of every surface (6 m) and its
images filled by the place. The second flight is the first one flown again by somebody else: metres beside it, a little higher or lower, faster
or slower, through a camera that blurs and has noise; every other one has another light. The same seed writes the same files.
"""
import argparse
import json
import math
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile

KINDS = ["straight", "orbit", "lawnmower", "hover-turn", "climb"]
LENSES = {"60": "camera-60.yaml", "90": "camera-90.yaml", "155": "camera-155.yaml"}
FPS, SECONDS = 8, 20
BUILT_IN = ["town-1", "suburb-1", "ravine-1", "works-1", "woods-1", "fort-1"]
TRIES = 60


class Place:
    def __init__(self, line):
        words = line.split()
        if len(words) != 9:
            sys.exit(f"draw_flights: this line needs nine words, NAME SOURCE SECOND LATITUDE LONGITUDE HEIGHT EAST NORTH UP: {line.strip()}")
        self.name, self.source, self.second = words[:3]
        self.origin, self.size = [float(w) for w in words[3:6]], [float(w) for w in words[6:]]


def draw(rng, place, kind):
    """A flight's numbers."""
    reach = 0.42 * min(place.size[:2])
    height = math.exp(rng.uniform(math.log(15), math.log(60)))
    return {"kind": kind, "lens": rng.choice(list(LENSES)), "height": height, "heading": rng.uniform(0, 360), "reach": reach,
            "speed": min(6.0, max(1.5, height * rng.uniform(0.06, 0.15))), "pitch": -rng.uniform(30, 85), "view": 0.0 if rng.random() < 0.6 else rng.uniform(0, 360),
            "at": [rng.uniform(-0.7, 0.7) * reach, rng.uniform(-0.7, 0.7) * reach], "turn": rng.choice([-1, 1]), "radius": rng.uniform(18, 45), "arc": rng.uniform(60, 150)}


def flown_again(rng, flight):
    again = dict(flight)
    again["at"] = [a + rng.gauss(0, 3) for a in flight["at"]]
    again["height"] *= rng.uniform(0.9, 1.1)
    again["speed"] *= rng.uniform(0.85, 1.15)
    again["heading"] += rng.gauss(0, 5)
    again["pitch"] = max(-88.0, again["pitch"] + rng.gauss(0, 4))
    return again


def waypoints(flight, ground):
    """Positions with their view, [east, north, up, yaw, pitch] or [east, north, up, look at]."""
    length, z = flight["speed"] * SECONDS, ground + flight["height"]
    heading, yaw = math.radians(flight["heading"]), flight["heading"] + flight["view"]
    along, (x, y) = (math.sin(heading), math.cos(heading)), flight["at"]

    def at(distance, side=0.0):
        return x + distance * along[0] + side * along[1], y + distance * along[1] - side * along[0]

    if flight["kind"] == "orbit":
        turned = [flight["turn"] * length / flight["radius"] * k / 8 + heading for k in range(9)]
        return [(x + flight["radius"] * math.sin(a), y + flight["radius"] * math.cos(a), z, (x, y, ground)) for a in turned]
    if flight["kind"] == "lawnmower":
        leg, spacing = length / 3.4, 0.4 * flight["height"]
        corners = [(0, 0), (leg, 0), (leg, spacing), (0, spacing), (0, 2 * spacing), (leg, 2 * spacing)]
        return [(*at(d - leg / 2, s - spacing), z, yaw, min(-60.0, flight["pitch"])) for d, s in corners]
    if flight["kind"] == "hover-turn":
        end = yaw + flight["turn"] * flight["arc"]
        stop = at(0.15 * length)
        return [(*at(-0.25 * length), z, yaw, flight["pitch"]), (*stop, z, yaw, flight["pitch"]), (*stop, z + 0.5, end, flight["pitch"]), (*at(0.5 * length), z, end, flight["pitch"])]
    if flight["kind"] == "climb":
        return [(*at((k / 4 - 0.5) * 0.6 * length), z + 0.8 * flight["height"] * k / 4, yaw, flight["pitch"]) for k in range(5)]
    return [(*at((k / 3 - 0.5) * length), z, yaw, flight["pitch"]) for k in range(4)]


def flight_text(flight, ground, cameras):
    lines = [f"# {flight['kind']}, {flight['height']:.0f} m above the middle's ground, {flight['lens']} degrees; drawn by draw_flights.py",
             f"camera: {pathlib.PurePath(cameras, LENSES[flight['lens']])}", f"fps: {FPS}", f"speed_m_s: {flight['speed']:.2f}", "acceleration_m_s2: 2", "yaw_rate_deg_s: 30",
             f"max_frames: {FPS * SECONDS}", "waypoints:"]
    for point in waypoints(flight, ground):
        position = "[" + ", ".join(f"{v:.2f}" for v in point[:3]) + "]"
        if len(point) == 4:
            lines.append(f"  - {{position: {position}, look_at: [" + ", ".join(f"{v:.2f}" for v in point[3]) + "]}")
        else:
            lines.append(f"  - {{position: {position}, yaw_deg: {point[3] % 360:.1f}, pitch_deg: {point[4]:.1f}}}")
    return "\n".join(lines) + "\n"


def run(program, *words):
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True)
    return json.loads(done.stdout) if done.returncode == 0 and done.stdout else None


def suits(program, tiles, place, text, folder, reach):
    """Whether a flight stays within reach, clear of surfaces, and sees the place."""
    file = folder / "flight.yaml"
    file.write_text(text, encoding="utf-8")
    for line in text.splitlines():
        if "position" in line:
            east, north = [float(v) for v in line.split("[")[1].split("]")[0].split(",")[:2]]
            if math.hypot(east, north) > reach:
                return False
    found = run(program, "preview", tiles, "--flight", file, "--origin", ",".join(map(str, place.origin)), "--out", folder / "preview", "--force", "--json")
    return found is not None and found["clearance"]["min"] > 6.0 and not found["faults"] and all(p["surface_share"] > 0.6 for p in found["pictures"]) and found["frames"] >= 0.7 * FPS * SECONDS


def ground_at(program, tiles, place):
    """Height of the uppermost surface at the origin, in the local frame."""
    found = run(program, "inspect", tiles, "--at", f"{place.origin[0]},{place.origin[1]}", "--origin", ",".join(map(str, place.origin)), "--json")
    highest = found["points"][0].get("highest") if found else None
    if not highest:
        sys.exit(f"draw_flights: {tiles} has no surface at {place.origin[0]}, {place.origin[1]}, the place's origin")
    return highest["local_z"]


def experiment_text(name, place, flights, light, seed):
    def render(which, source):
        return [f"    flight: {name}-{which}.yaml", f"    source: {source}"]

    lines = [f"# {place.name}: {flights['simulated']['kind']}; drawn by draw_flights.py", f"name: {name}", f"seed: {seed}", "place:", f"  source: {place.source}",
             f"  center: [{', '.join(f'{v:g}' for v in place.origin)}]", f"  origin: [{', '.join(f'{v:g}' for v in place.origin)}]",
             f"  size: [{', '.join(f'{v:g}' for v in place.size)}]", "truth: {voxel: 1.0}", "simulated:", "  render:", *render("simulated", place.source), "real:", "  kind: surrogate",
             "  render:", *render("second", place.second), "    degrade: {exposure_time: 0.006, exposure_samples: 3, vignetting: 0.4, exposure_drift: 0.15,"]
    lines.append("              white_electrons: 6000, read_noise_electrons: 12, video_crf: 20" + ("," if light else "}"))
    if light:
        lines.append(f"              light: {{model: sun-and-sky, time: \"{light}\"}}}}")
    return "\n".join(lines) + "\n"


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("out", type=pathlib.Path)
    options.add_argument("--places", type=pathlib.Path)
    options.add_argument("--flights", type=int, default=2)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--program", default="tileflight")
    options = options.parse_args()
    lines = options.places.read_text(encoding="utf-8").splitlines() if options.places else [f"{n} {n}:twin {n}:world 30 -40 50 190 190 140" for n in BUILT_IN]
    places = [Place(line) for line in lines if line.strip() and not line.startswith("#")]
    cameras = pathlib.Path(__file__).resolve().parent
    options.out.mkdir(parents=True, exist_ok=True)
    for camera in LENSES.values():
        if options.out.resolve() != cameras:
            shutil.copy(cameras / camera, options.out)

    def schema(name):
        return f"# yaml-language-server: $schema={os.path.relpath(cameras.parents[1] / 'schemas' / name, options.out.resolve())}.schema.json\n"

    study, count = [], 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for place in places:
            tiles = place.source
            if tiles.split(":")[0].split("-")[0] in {n.split("-")[0] for n in BUILT_IN} and ":" in tiles:
                kind, seed = tiles.split(":")[0].split("-")
                if subprocess.run([options.program, "scene", kind, folder / place.name, "--seed", seed, "--quiet"]).returncode != 0:
                    sys.exit(1)
                tiles = folder / place.name / tiles.split(":")[1]
            ground = ground_at(options.program, tiles, place)
            for k in range(options.flights):
                seed = options.seed * 1000 + count
                kind, found = KINDS[count % len(KINDS)], None
                for number in range(TRIES):
                    rng = random.Random(f"{place.name} {seed} {number}")
                    first = draw(rng, place, kind)
                    both = {"simulated": first, "second": flown_again(rng, first)}
                    if all(suits(options.program, tiles, place, flight_text(f, ground, cameras), folder, 1.15 * first["reach"]) for f in both.values()):
                        found = both
                        break
                count += 1
                if not found:
                    print(f"{place.name}: no flight of the kind {kind} found a way in {TRIES} draws; left out", file=sys.stderr)
                    continue
                entry = f"{place.name}-{kind}-{seed}"
                light = ["", "2024-06-21T18:00:00Z"][k % 2]
                for which, flight in found.items():
                    (options.out / f"{entry}-{which}.yaml").write_text(schema("flight") + flight_text(flight, ground, ""), encoding="utf-8")
                (options.out / f"{entry}.yaml").write_text(schema("experiment") + experiment_text(entry, place, found, light, seed), encoding="utf-8")
                study.append(f"  {entry}: {{experiment: {entry}.yaml, site: {place.name}, kind: {kind}}}")
                print(f"{entry}: {found['simulated']['height']:.0f} m, {found['simulated']['lens']} degrees, {found['simulated']['speed']:.1f} m/s (draw {number + 1})", flush=True)
    (options.out / "study.yaml").write_text(schema("study") + "# Drawn by draw_flights.py. Add your system, and run: tileflight study study.yaml --out OUT\nname: benchmark\nrank_by: ate\n"
                                            "places:\n" + "\n".join(study) + "\nsystems:\n  tileflight:\n", encoding="utf-8")


if __name__ == "__main__":
    main()
