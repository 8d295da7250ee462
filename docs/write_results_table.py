#!/usr/bin/env python3
"""Writes the numbers of README's table of the experiment from finished runs, so that they cannot be stale.

  docs/write_results_table.py [--demo out/stadium] [--full out/stadium-paper] [--check]

--demo: the run of examples/stadium.yaml; --full: that of examples/stadium-paper.yaml. Columns of a run that is not named stay.
--check: changes nothing; exit 1 if README has other numbers.
"""
import argparse
import json
import sys
from pathlib import Path

README = Path(__file__).resolve().parent.parent / "README.md"
# Columns behind the row's name: paper simulated and real, full size simulated and surrogate, demo simulated and surrogate.
COLUMNS = {"full": (3, 4), "demo": (5, 6)}


def thousands(count):
    return f"{count:,}".replace(",", " ")


ROWS = {
    "map points": lambda flight: thousands(flight["map"]["points"]),
    "within 1 m of a voxel centre": lambda flight: thousands(flight["map"]["correspondences"]),
    "mean error, m": lambda flight: f"{flight['map']['mean']:.4f}",
    "standard deviation, m": lambda flight: f"{flight['map']['std']:.4f}",
    "floor: mean of a perfect map, m": lambda flight: f"{flight['map']['quantization_floor']['mean']:.4f}",
    "median to the exact surface, m": lambda flight: f"{flight['surface']['median']:.3f}",
    "path error (ATE), m": lambda flight: f"{flight['trajectory']['ate_rmse']:.3f}",
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--demo", type=Path)
    parser.add_argument("--full", type=Path)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    lines = README.read_text().split("\n")
    stale, written = [], set()
    for number, line in enumerate(lines):
        cells = line.split("|")
        row = cells[1].strip() if len(cells) == 9 else ""
        if row not in ROWS:
            continue
        written.add(row)
        for size, columns in COLUMNS.items():
            folder = getattr(options, size)
            if folder is None:
                continue
            results = json.loads((folder / "results.json").read_text())
            for column, flight in zip(columns, ("simulated", "real")):
                value = ROWS[row](results[flight])
                if cells[column + 1].strip() != value:
                    stale.append(f"{row} ({size}, {flight}): README has {cells[column + 1].strip()}, the run {value}")
                cells[column + 1] = f" {value} "
        lines[number] = "|".join(cells)
    if missing := set(ROWS) - written:
        sys.exit(f"{README}: its table has no row '{min(missing)}'")
    if options.check:
        for text in stale:
            print(text)
        return 1 if stale else 0
    README.write_text("\n".join(lines))
    return 0


sys.exit(main())
