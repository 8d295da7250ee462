"""Makes docs/images/autopilot.jpg: a flight over the built-in stadium by a scripted autopilot that speaks ArduPilot's JSON interface.

Usage: make_autopilot_flight.py TILEFLIGHT TILESET OUT.jpg
TILESET is the stadium's `world` (`tileflight scene stadium DIR` writes DIR/world). It prints how fast the flight was. Needs
matplotlib, numpy and msgpack (Debian's python3-matplotlib, python3-numpy, python3-msgpack).
"""
import json
import pathlib
import socket
import struct
import subprocess
import sys
import tempfile
import time

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "clients/python"))
import tileflight_airsim as airsim  # noqa: E402

RATE = 400
CRUISE_M = 25.0
SQUARE = [(0, 0), (40, 0), (40, 40), (0, 40), (0, 0)]  # north, east, metres from the start
WIND = (3.0, -2.0)
SETTINGS = {"Wind": {"X": WIND[0], "Y": WIND[1], "Z": 0},
            "Vehicles": {"Copter": {"VehicleType": "ArduCopter", "ControlPort": 0}},
            "CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 320, "Height": 240, "FOV_Degrees": 80}]}}

MASS_KG, INERTIA = 1.0, np.array([0.00672, 0.00804, 0.01428])
MAX_THRUST_N, TORQUE_PER_THRUST_M, EXPO = 4.1795, 1.23827e-7 / 9.3144e-6, 0.65
# Forward, right, and spin seen from above (1: counter-clockwise), in ArduPilot's order.
MOTORS = np.array([(0.1609, 0.1609, 1), (-0.1609, -0.1609, 1), (0.1609, -0.1609, -1), (-0.1609, 0.1609, -1)])
MIXER = np.linalg.pinv(np.stack([np.ones(4), -MOTORS[:, 1], MOTORS[:, 0], TORQUE_PER_THRUST_M * MOTORS[:, 2]]))


class Autopilot:
    """Position -> velocity (PI) -> attitude and thrust -> rates -> motors; NED, body forward, right, down."""

    def __init__(self):
        self.points = [np.array([n, e, -CRUISE_M]) for n, e in SQUARE]
        self.drift = np.zeros(3)
        self.landing = self.done = False
        self.still_s = 0.0

    def outputs(self, state):
        position, velocity = np.array(state["position"]), np.array(state["velocity"])
        R, gyro = rotation(state["quaternion"]), np.array(state["imu"]["gyro"])
        goal = self.points[0] if self.points else np.array([0.0, 0.0, position[2]])
        if self.points and np.linalg.norm(goal - position) < 1.0:
            self.points.pop(0)
        self.landing = not self.points
        self.still_s = self.still_s + 1 / RATE if self.landing and abs(velocity[2]) < 0.1 else 0.0
        self.done = self.still_s > 0.5
        wanted = goal - position
        wanted[:2] *= min(1.0, 6.0 / max(1e-9, np.hypot(*wanted[:2])))
        wanted[2] = min(1.5, max(0.5, -0.15 * position[2])) if self.landing else np.clip(wanted[2], -3, 3)
        error = wanted - velocity
        self.drift = np.clip(self.drift + 0.6 / RATE * error, -3, 3)
        push = np.clip(2.5 * error + self.drift, -4, 4)
        thrust = MASS_KG * (push - [0, 0, 9.80665])
        down = -thrust / np.linalg.norm(thrust)
        right = np.cross(down, [1, 0, 0]) / np.linalg.norm(np.cross(down, [1, 0, 0]))
        goal_R = np.stack([np.cross(right, down), right, down], axis=1)
        skew = 0.5 * (goal_R.T @ R - R.T @ goal_R)
        tilted = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
        torque = INERTIA * np.array([25, 25, 10]) * (-np.array([8, 8, 3]) * tilted - gyro)
        shares = np.clip(MIXER @ np.concatenate([[-thrust @ R[:, 2]], torque]) / MAX_THRUST_N, 0, 1)
        return (np.sqrt((1 - EXPO) ** 2 + 4 * EXPO * shares) - (1 - EXPO)) / (2 * EXPO)


def rotation(q):
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def fly(port, client):
    """States of the whole flight, four pictures, and simulated seconds in one of the wall clock."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.settimeout(30)
    link.connect(("127.0.0.1", port))
    pilot, states, pictures, frame = Autopilot(), [], [], 0
    outputs, spent_s = np.zeros(4), 0.0
    while not pilot.done:
        pwm = [1000 + round(1000 * u) for u in outputs] + [1000] * 12
        sent = time.monotonic()
        link.send(struct.pack("<HHI16H", 18458, RATE, frame, *pwm))
        states.append(json.loads(link.recv(65536)))
        spent_s += time.monotonic() - sent
        frame += 1
        outputs = pilot.outputs(states[-1]) if states[-1]["timestamp"] > 1 else np.zeros(4)
        if len(pictures) < 4 and len(pilot.points) < len(SQUARE) - len(pictures) - 1 + 1e-9 and frame % 400 == 0:
            pictures.append(picture(client))
    return states, pictures, states[-1]["timestamp"] / spent_s


def picture(client):
    got, = client.simGetImages([airsim.ImageRequest("bottom_center", airsim.ImageType.Scene, False, False)])
    return np.frombuffer(got.image_data_uint8, np.uint8).reshape(got.height, got.width, 3)[:, :, ::-1]


def draw(states, pictures, out):
    t = np.array([s["timestamp"] for s in states])
    p = np.array([s["position"] for s in states])
    tilt = np.degrees([np.arccos(np.clip(rotation(s["quaternion"])[2, 2], -1, 1)) for s in states])
    force = np.linalg.norm([s["imu"]["accel_body"] for s in states], axis=1)
    figure = plt.figure(figsize=(11, 7), layout="constrained")
    grid = figure.add_gridspec(3, 4)
    above = figure.add_subplot(grid[0:2, 0:2])
    above.plot(p[:, 1], p[:, 0])
    above.plot(*np.array(SQUARE).T[::-1], "+", color="black")
    above.set(xlabel="east, m", ylabel="north, m", aspect="equal", title="path from above, corners of the square")
    for row, (values, label) in enumerate([(-p[:, 2], "height, m"), (tilt, "tilt, degrees")]):
        axes = figure.add_subplot(grid[row, 2:4])
        axes.plot(t, values)
        axes.set(xlabel="time, s", ylabel=label)
    axes.plot(t, force, linewidth=0.5, label="specific force, m/s²")
    axes.legend()
    for column, image in enumerate(pictures):
        axes = figure.add_subplot(grid[2, column])
        axes.imshow(image)
        axes.axis("off")
    figure.savefig(out, dpi=90, pil_kwargs={"quality": 85})


def main(tileflight, tileset, out):
    with tempfile.TemporaryDirectory() as folder:
        settings = pathlib.Path(folder) / "settings.json"
        settings.write_text(json.dumps(SETTINGS))
        server = subprocess.Popen([tileflight, "serve", tileset, "--settings", settings, "--port", "0", "--json"],
                                  stdout=subprocess.PIPE, text=True)
        try:
            text = ""
            while not text.endswith("\n}\n"):
                text += server.stdout.readline()
            ready = json.loads(text)
            client = airsim.MultirotorClient(port=ready["port"])
            states, pictures, speed = fly(ready["autopilots"][0]["port"], client)
        finally:
            server.terminate()
            server.wait()
    draw(states, pictures, out)
    print(f"{states[-1]['timestamp']:.1f} s flown, landed {np.hypot(*states[-1]['position'][:2]):.2f} m from the start; "
          f"the simulator's part at {speed:.1f} times real time")


if __name__ == "__main__":
    main(*sys.argv[1:4])
