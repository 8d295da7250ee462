"""Makes docs/images/real-autopilots.jpg of the flights that examples/fly_square.py has flown.

Usage: draw_square_flights.py OUT.jpg NAME=FOLDER...
For each: path from above, height and the autopilot's modes over time, and four pictures of the camera below. Prints how far the
path was from the square's corners, and how far from its start it landed. Needs matplotlib and numpy.
"""
import csv
import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

SQUARE = np.array([(0, 0), (40, 0), (40, 40), (0, 40), (0, 0)], float)  # north, east, metres from the start
PICTURES = 4


def read(folder):
    with (folder / "flight.csv").open(encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    numbers = np.array([[float(row[key]) for key in ("time_s", "north_m", "east_m", "down_m")] for row in rows])
    return numbers[:, 0] - numbers[0, 0], numbers[:, 1:], [row["mode"] for row in rows]


def pictures(folder, count):
    files = sorted((folder / "frames").glob("*.png"))
    chosen = [files[round((i + 0.5) * len(files) / count)] for i in range(count)]
    return [(int(file.stem) / 1000, plt.imread(file)) for file in chosen]


def draw_row(figure, grid, row, name, folder):
    t, p, modes = read(folder)
    above = figure.add_subplot(grid[row, 0])
    above.plot(p[:, 1], p[:, 0])
    above.plot(*SQUARE.T[::-1], "+", color="black")
    above.set(xlabel="east, m", ylabel="north, m", aspect="equal")
    above.set_title(name, fontsize=10)
    axes = figure.add_subplot(grid[row, 1])
    axes.plot(t, -p[:, 2])
    for i in range(1, len(modes)):
        if modes[i] != modes[i - 1]:
            axes.axvline(t[i], color="grey", linewidth=0.5)
            axes.annotate(modes[i], (t[i], 0.5), rotation=90, fontsize=7, color="grey", xycoords=("data", "axes fraction"), va="center")
    axes.set(xlabel="time, s", ylabel="true height, m")
    for column, (at_s, image) in enumerate(pictures(folder, PICTURES)):
        axes = figure.add_subplot(grid[row, 2 + column])
        axes.imshow(image)
        axes.set_title(f"{at_s:.0f} s", fontsize=8)
        axes.axis("off")
    nearest = [np.linalg.norm(p[:, :2] - corner, axis=1).min() for corner in SQUARE[1:]]
    print(f"{name}: {t[-1]:.0f} s, nearest to the corners {', '.join(f'{d:.2f}' for d in nearest)} m, highest {-p[:, 2].min():.1f} m, "
          f"landed {np.hypot(*p[-1, :2]):.2f} m from the start")


def main(out, *flights):
    figure = plt.figure(figsize=(13, 2.4 * len(flights)), layout="constrained")
    figure.get_layout_engine().set(h_pad=0.12)
    grid = figure.add_gridspec(len(flights), 2 + PICTURES, width_ratios=[1, 1.3] + [1] * PICTURES)
    for row, flight in enumerate(flights):
        name, folder = flight.split("=", 1)
        draw_row(figure, grid, row, name, pathlib.Path(folder))
    figure.savefig(out, dpi=90, pil_kwargs={"quality": 85})


if __name__ == "__main__":
    main(*sys.argv[1:])
