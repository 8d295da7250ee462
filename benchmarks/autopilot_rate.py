"""How fast vehicles with ArduPilot's interface fly: simulated seconds in one of the wall clock, with and without cameras.

    PYTHONPATH=clients/python TILEFLIGHT_BINARY=build/release/bin/tileflight python3 benchmarks/autopilot_rate.py \\
        PLACE/world/tileset.json [--vehicles 8] [--pictures-hz 10] [--seconds 6]

Every packet asks for the same thrust, a little more than the weight, so that nothing is computed between them. 400 packets a
simulated second, pictures of 320 x 240, one after the other.
"""
import argparse
import json
import os
import pathlib
import socket
import struct
import subprocess
import tempfile
import time

import tileflight_airsim as airsim

RATE = 400
PULSE_US = 1740


def settings(vehicles):
    return {"CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 320, "Height": 240, "FOV_Degrees": 80}]},
            "Vehicles": {f"C{i}": {"VehicleType": "ArduCopter", "ControlPort": 0, "X": 3 * i} for i in range(vehicles)}}


def start(tileset, folder, vehicles):
    file = pathlib.Path(folder) / "settings.json"
    file.write_text(json.dumps(settings(vehicles)))
    server = subprocess.Popen([os.environ["TILEFLIGHT_BINARY"], "serve", tileset, "--settings", file, "--port", "0", "--json", "--quiet"],
                              stdout=subprocess.PIPE, text=True)
    lines = []
    while not lines or not lines[-1].startswith("}"):
        lines.append(server.stdout.readline())
    return server, json.loads("".join(lines))


def fly(ready, seconds, pictures_hz):
    """(seconds of the wall clock, pictures, metres climbed by the first vehicle)"""
    client = airsim.MultirotorClient(port=ready["port"])
    links = []
    for where in ready["autopilots"]:
        links.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        links[-1].settimeout(60)
        links[-1].connect((where["address"], where["port"]))
    request = [airsim.ImageRequest("front_center", airsim.ImageType.Scene, False, False)]
    began, pictures = time.monotonic(), 0
    for frame in range(int(RATE * seconds)):
        for link in links:
            link.send(struct.pack("<HHI16H", 18458, RATE, frame, *[PULSE_US] * 16))
        states = [link.recv(65536) for link in links]
        if pictures_hz and (frame + 1) % (RATE // pictures_hz) == 0:
            for i in range(len(links)):
                client.simGetImages(request, vehicle_name=f"C{i}")
                pictures += 1
    spent = time.monotonic() - began
    for link in links:
        link.close()
    return spent, pictures, -json.loads(states[0])["position"][2]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tileset")
    parser.add_argument("--vehicles", type=int, default=1)
    parser.add_argument("--pictures-hz", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=6.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        server, ready = start(options.tileset, folder, options.vehicles)
        try:
            spent, pictures, climbed = fly(ready, options.seconds, options.pictures_hz)
        finally:
            server.terminate()
            server.wait()
    print(f"{options.vehicles} vehicles, {pictures} pictures, climbed {climbed:.1f} m: {options.seconds / spent:.2f} times real time")


if __name__ == "__main__":
    main()
