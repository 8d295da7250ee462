"""Makes docs/images/vision-flight.jpg: a flight without a receiver by the scripted autopilot of the tests.

Usage: make_vision_flight.py FLIGHT.csv OUT.jpg
FLIGHT.csv is what `scripted_autopilot px4-vision` prints. It prints how far the autopilot's own path is from the true one
while vision comes, after moving its place at the first message onto the true one. Needs matplotlib and numpy.
"""
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

TRUTH, OWN, MESSAGES = slice(1, 4), slice(4, 7), 7


def main(flight, out):
    rows = np.loadtxt(flight, delimiter=",")
    seen = rows[rows[:, MESSAGES] > 0]
    own = seen[:, OWN] - seen[0, OWN] + seen[0, TRUTH]
    error = np.linalg.norm(own - seen[:, TRUTH], axis=1)
    way = np.linalg.norm(np.diff(seen[:, TRUTH], axis=0), axis=1).sum()
    print(f"vision from {seen[0, 0]:.1f} s on, {way:.0f} m: root mean square {np.sqrt((error ** 2).mean()):.2f} m, "
          f"largest {error.max():.2f} m, at the end {error[-1]:.2f} m")
    figure, (plan, height, errors) = plt.subplots(1, 3, figsize=(12, 3.8))
    plan.plot(rows[:, 2], rows[:, 1], color="0.7", lw=3, label="truth")
    plan.plot(own[:, 1], own[:, 0], color="tab:red", lw=1, label="by vision")
    plan.set(xlabel="east, m", ylabel="north, m", aspect="equal", adjustable="datalim")
    plan.legend(loc="center")
    height.plot(rows[:, 0], -rows[:, 3], color="0.7", lw=3)
    height.plot(seen[:, 0], -own[:, 2], color="tab:red", lw=1)
    height.set(xlabel="s", ylabel="height, m")
    errors.plot(seen[:, 0], error, color="tab:red", lw=1)
    errors.set(xlabel="s", ylabel="error since the first message, m", ylim=(0, None))
    figure.tight_layout()
    figure.savefig(out, dpi=80)


if __name__ == "__main__":
    main(*sys.argv[1:3])
