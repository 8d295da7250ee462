"""CPU time of Scene images in weather and by daylight, relative to plain ones.

Usage: PYTHONPATH=clients/python /usr/bin/python3 benchmarks/weather_cost.py TILEFLIGHT TILESET [IMAGES]
TILESET is the stadium's (`tileflight scene stadium DIR` writes DIR/twin). Serves it on one thread and asks for images of 640 x 480 pixels from a circle
around the stadium; the time is what the server's process spends, so that other work on the machine counts little.
"""
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import tileflight_airsim as airsim

SETTINGS = {"SettingsVersion": 1.2, "SimMode": "ComputerVision", "StepOnDemand": True,
            "OriginGeopoint": {"Latitude": 35.310344, "Longitude": -80.740007, "Altitude": 190},
            "CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 640, "Height": 480, "FOV_Degrees": 80}]}}
KINDS = ["plain", "fog 0.5", "fog 0.5 and wet ground", "rain 0.3 (9 mm/h)", "rain 0.7 (49 mm/h)", "snow 0.3 (0.9 mm/h)", "daylight", "daylight, fog 0.3"]


def set_up(client, kind):
    weather = airsim.WeatherParameter
    for parameter in (weather.Fog, weather.Rain, weather.Snow, weather.Roadwetness):
        client.simSetWeatherParameter(parameter, 0.0)
    client.simEnableWeather(kind != "plain")
    for word, parameter in (("fog", weather.Fog), ("rain", weather.Rain), ("snow", weather.Snow)):
        if word in kind:
            client.simSetWeatherParameter(parameter, float(kind.split(word)[1].split()[0]))
    client.simSetWeatherParameter(weather.Roadwetness, 1.0 if "wet" in kind else 0.0)
    client.simSetTimeOfDay("daylight" in kind, "2024-03-20 10:00:00", False, 0, 60, True)


def cpu_s(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def pictures(client, count):
    for i in range(count):
        angle = 2 * math.pi * i / count
        pose = airsim.Pose(airsim.Vector3r(-140 * math.cos(angle), -140 * math.sin(angle), -45), airsim.to_quaternion(-0.25, 0, angle))
        client.simSetVehiclePose(pose, True)
        client.simGetImages([airsim.ImageRequest("0", 0, False, False)])


def main(tileflight, tileset, images):
    with tempfile.TemporaryDirectory() as folder:
        settings = pathlib.Path(folder) / "settings.json"
        settings.write_text(json.dumps(SETTINGS), encoding="utf-8")
        server = subprocess.Popen([tileflight, "serve", tileset, "--settings", str(settings), "--port", "0", "--json", "--threads", "1"],
                                  stdout=subprocess.PIPE, text=True)
        try:
            text = ""
            while not text.endswith("}\n"):
                text += server.stdout.readline()
            client = airsim.VehicleClient(port=json.loads(text)["port"], timeout_value=600)
            spent = dict.fromkeys(KINDS, 0.0)
            for round_ in range(3):  # by turns, so that a busy spell of the machine meets all
                for kind in KINDS:
                    set_up(client, kind)
                    if round_ == 0:
                        pictures(client, 2)
                    before = cpu_s(server.pid)
                    pictures(client, images)
                    spent[kind] += cpu_s(server.pid) - before
            for kind in KINDS:
                print(f"{kind:28s} {1e3 * spent[kind] / (3 * images):7.1f} ms {spent[kind] / spent['plain']:6.2f} x")
        finally:
            server.terminate()
            server.wait()


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]) if len(sys.argv) == 4 else 40)
