"""A small place made for tests: hills with a texture of random squares, as a tileset; made once a process."""

import atexit
import functools
import pathlib
import shutil
import struct
import tempfile
import zlib

import numpy as np

import tileflight as tf

SIZE_M = 80.0
#: All of it: with a region, commands take these tiles and not those that a flight sees.
REGION = {"center_local": (0, 0, 0), "size": (90, 90, 20)}


def _png(image):
    height, width, _ = image.shape
    rows = b"".join(b"\0" + image[y].tobytes() for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def height_m(x, y):
    return 3.0 * np.sin(x / 7.0) * np.cos(y / 9.0)


def _texture():
    random = np.random.default_rng(5)
    image = np.zeros((1024, 1024, 3))
    for cells in (16, 64, 256):
        squares = random.uniform(0, 255, (cells, cells, 1)).repeat(3, axis=2)
        image += squares.repeat(1024 // cells, axis=0).repeat(1024 // cells, axis=1) / 3
    return image.astype(np.uint8)


@functools.lru_cache(maxsize=None)
def work_folder():
    folder = pathlib.Path(tempfile.mkdtemp(prefix="tileflight-python-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@functools.lru_cache(maxsize=None)
def tileset():
    """The folder of the tileset, not georeferenced: its own frame is the local one."""
    folder = work_folder()
    n = 41
    axis = np.linspace(-SIZE_M / 2, SIZE_M / 2, n)
    (folder / "ground.png").write_bytes(_png(_texture()))
    (folder / "ground.mtl").write_text("newmtl ground\nmap_Kd ground.png\n")
    lines = ["mtllib ground.mtl", "usemtl ground"]
    for y in axis:
        lines += [f"v {x:.6f} {y:.6f} {height_m(x, y):.6f}" for x in axis]
    for j in range(n):
        lines += [f"vt {i / (n - 1):.6f} {j / (n - 1):.6f}" for i in range(n)]
    for j in range(n - 1):
        for i in range(n - 1):
            a, b, c, d = (k + 1 for k in (j * n + i, j * n + i + 1, (j + 1) * n + i, (j + 1) * n + i + 1))
            lines += [f"f {a}/{a} {b}/{b} {d}/{d}", f"f {a}/{a} {d}/{d} {c}/{c}"]
    (folder / "ground.obj").write_text("\n".join(lines) + "\n")
    tf.tile(folder / "ground.obj", out=folder / "tiles")
    return folder / "tiles"


@functools.lru_cache(maxsize=None)
def scene():
    return tf.load(tileset(), **REGION)


@functools.lru_cache(maxsize=None)
def dataset():
    """The flight as the command renders it."""
    tf.render(tileset(), **REGION, flight=flight_file(), out=work_folder() / "flown", png=True)
    return work_folder() / "flown"


@functools.lru_cache(maxsize=None)
def scene_of_the_flight():
    """The place as the command loads it: single-precision coordinates count from the middle of the flight."""
    poses = tf.Flight.plan(str(flight_file())).poses
    return tf.load(str(tileset()), **REGION, anchor=poses[len(poses) // 2, :3, 3])


def looking_down(x, y, z, yaw=0.0):
    """T_local_camera of a camera that looks straight down; image up is north, turned by yaw (radians)."""
    pose = np.eye(4)
    c, s = np.cos(yaw), np.sin(yaw)
    pose[:3, :3] = np.array([[c, s, 0], [s, -c, 0], [0, 0, -1]])
    pose[:3, 3] = x, y, z
    return pose


@functools.lru_cache(maxsize=None)
def flight_file():
    file = work_folder() / "flight.yaml"
    tf.Camera.pinhole(320, 240, 80).write(work_folder() / "camera.yaml")
    file.write_text(
        """camera: camera.yaml
fps: 8
speed_m_s: 4
acceleration_m_s2: 3
yaw_rate_deg_s: 20
waypoints:
  - {position: [-16, -6, 22], yaw_deg: 60, pitch_deg: -75}
  - {position: [0, 2, 21], yaw_deg: 64, pitch_deg: -72}
  - {position: [14, 8, 22], yaw_deg: 60, pitch_deg: -75}
"""
    )
    return file
