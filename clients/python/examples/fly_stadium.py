#!/usr/bin/env python3
"""Flies around the stadium and keeps what the camera saw as a dataset that `tileflight odometry` reads.

    build/release/bin/tileflight scene stadium place
    build/release/bin/tileflight serve place/twin/tileset.json --settings clients/python/examples/stadium_settings.json &
    PYTHONPATH=clients/python python3 clients/python/examples/fly_stadium.py --out stadium-dataset
    build/release/bin/tileflight odometry stadium-dataset --out stadium-odometry

The simulation stands still while a picture is taken: pictures are 1/fps of its time apart (in whole steps of its clock,
3 ms), however long they take to compute, and each has the pose of its own instant.
"""
import argparse
import math
import pathlib
import struct
import zlib

import tileflight_airsim as airsim

CAMERA = "front_center"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", default="stadium-dataset", help="folder to write")
    parser.add_argument("--port", type=int, default=41451)
    parser.add_argument("--token")
    parser.add_argument("--fps", type=float, default=5.0)
    parser.add_argument("--speed", type=float, default=4.0, help="m/s")
    parser.add_argument("--height", type=float, default=20.0, help="m above the start")
    parser.add_argument("--radius", type=float, default=25.0, help="m")
    parser.add_argument("--frames", type=int, default=10000, help="at most")
    options = parser.parse_args()
    with airsim.MultirotorClient(port=options.port, token=options.token) as client:
        client.confirmConnection()
        take_off(client, options)
        dataset = Dataset(pathlib.Path(options.out))
        fly_and_look(client, options, dataset)
        dataset.finish(client)
        print(f"{options.out}: {dataset.count} frames, {dataset.length_m:.0f} m")


def take_off(client, options):
    client.reset()
    client.enableApiControl(True)
    client.armDisarm(True)
    client.takeoffAsync().join()
    client.moveToPositionAsync(options.radius, 0, -options.height, options.speed).join()
    client.simPause(True)


def fly_and_look(client, options, dataset):
    """Once around at the height, looking ahead along the path."""
    circle = [airsim.Vector3r(options.radius * math.cos(a), options.radius * math.sin(a), -options.height)
              for a in (2 * math.pi * i / 36 for i in range(37))]
    flight = client.moveOnPathAsync(circle, options.speed, 600, airsim.DrivetrainType.ForwardOnly,
                                    airsim.YawMode(False, 0))
    while not flight.done() and dataset.count < options.frames:
        client.simContinueForTime(1 / options.fps)
        image = client.simGetImages([airsim.ImageRequest(CAMERA, airsim.ImageType.Scene, False, False)])[0]
        dataset.add(image)
    client.simPause(False)
    client.cancelLastTask()
    if flight.get() is not True and dataset.count < options.frames:
        print("the flight has ended early:", client.simGetCollisionInfo())


class Dataset:
    """images/, times.txt, groundtruth.txt (TUM, camera to east-north-up), camera.yaml (Kalibr)."""

    def __init__(self, folder):
        self.folder, self.count, self.length_m, self.last = folder, 0, 0.0, None
        (folder / "images").mkdir(parents=True, exist_ok=False)
        self.times = open(folder / "times.txt", "w", encoding="ascii")
        self.poses = open(folder / "groundtruth.txt", "w", encoding="ascii")

    def add(self, image):
        name = f"{self.count:06}"
        time_s = f"{image.time_stamp // 10**9}.{image.time_stamp % 10**9:09}"
        write_png(self.folder / "images" / f"{name}.png", image.width, image.height, image.image_data_uint8)
        self.times.write(f"{name} {time_s} 0\n")
        numbers = [*position_enu(image.camera_position), *orientation_enu(image.camera_orientation)]
        self.poses.write(time_s + "".join(f" {number:.9g}" for number in numbers) + "\n")
        if self.last is not None:
            self.length_m += image.camera_position.distance_to(self.last.camera_position)
        self.last = image
        self.count += 1

    def finish(self, client):
        self.times.close()
        self.poses.close()
        width, height = self.last.width, self.last.height
        focal = width / 2 / math.tan(math.radians(client.simGetCameraInfo(CAMERA).fov) / 2)
        (self.folder / "camera.yaml").write_text(
            "cam0:\n  camera_model: pinhole\n"
            f"  intrinsics: [{focal:.9g}, {focal:.9g}, {(width - 1) / 2}, {(height - 1) / 2}]\n"
            "  distortion_model: radtan\n  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n"
            f"  resolution: [{width}, {height}]\n")


def position_enu(ned):
    return ned.y_val, ned.x_val, -ned.z_val


def orientation_enu(q):
    """(x, y, z, w) of camera axes right, down, forward in east, north, up; q: axes forward, right, down in NED."""
    half = math.sqrt(0.5)
    enu_ned = airsim.Quaternionr(half, half, 0, 0)  # north <-> east, down -> up: half a turn about their middle
    body_camera = airsim.Quaternionr(0.5, 0.5, 0.5, 0.5)  # forward -> right, right -> down, down -> forward
    return tuple(enu_ned * q * body_camera)


def write_png(path, width, height, bgr):
    rgb = bytearray(len(bgr))
    rgb[0::3], rgb[1::3], rgb[2::3] = bgr[2::3], bgr[1::3], bgr[0::3]
    rows = b"".join(b"\0" + rgb[3 * width * y:3 * width * (y + 1)] for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 1)) +
                     chunk(b"IEND", b""))


if __name__ == "__main__":
    main()
