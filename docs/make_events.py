"""Makes docs/images/events.jpg: events of 10 ms over the grey picture at their start, of a flight over the built-in stadium.

Usage: make_events.py DATASET OUT.jpg [FRAME ...]
DATASET is a rendered flight with events (docs/events.md). Needs h5py, numpy and Pillow.
"""
import pathlib
import sys

import h5py
import numpy as np
from PIL import Image

SPAN_US = 10_000
RED, BLUE = (226, 40, 30), (30, 80, 235)
SCALE = 2


def picture(dataset, frame, start_us):
    grey = Image.open(next((dataset / "images").glob(f"{frame:06d}.*"))).convert("L")
    pixels = np.repeat(np.asarray(grey)[:, :, None], 3, axis=2).astype(np.float64)
    pixels = 110 + 0.55 * pixels  # pale, so that events stand out
    with h5py.File(dataset / "events.h5") as file:
        first_us = start_us - int(file["t_offset"][()])
        ms = file["ms_to_idx"]
        begin, end = int(ms[first_us // 1000]), int(ms[min(len(ms) - 1, -(-(first_us + SPAN_US) // 1000))])
        x, y, t, p = (file[f"events/{name}"][begin:end] for name in "xytp")
    inside = (t >= first_us) & (t < first_us + SPAN_US)
    balance = np.zeros(pixels.shape[:2])
    np.add.at(balance, (y[inside], x[inside]), np.where(p[inside] == 1, 1, -1))
    pixels[balance > 0], pixels[balance < 0] = RED, BLUE
    print(f"frame {frame}: {int(inside.sum())} events in {SPAN_US / 1000:g} ms")
    image = Image.fromarray(pixels.astype(np.uint8))
    return image.resize((SCALE * image.width, SCALE * image.height), Image.NEAREST)


dataset = pathlib.Path(sys.argv[1])
times = [line.split() for line in (dataset / "times.txt").read_text().splitlines()]
frames = [int(frame) for frame in sys.argv[3:]] or [len(times) // 2]
views = [picture(dataset, frame, round(1e6 * float(times[frame][1]))) for frame in frames]
sheet = Image.new("RGB", (sum(view.width for view in views) + 6 * (len(views) - 1), views[0].height), "white")
left = 0
for view in views:
    sheet.paste(view, (left, 0))
    left += view.width + 6
sheet.save(sys.argv[2], quality=85)
