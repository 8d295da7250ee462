"""An MCAP file of a small dataset, read by MCAP's reference reader (npm @mcap/core) and Foxglove's decoder of ROS 2 messages.

Usage: check_mcap.py TILEFLIGHT FOLDER_OF_THIS_TEST WORK_FOLDER
Exits with 77 (skipped) where there is no node, or npm cannot fetch the packages.
"""
import json
import math
import pathlib
import shutil
import struct
import subprocess
import sys
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
from npm_packages import install  # noqa: E402

FRAMES = 3
CAMERA = """cam0:
  camera_model: pinhole
  intrinsics: [20.0, 21.0, 15.5, 11.5]
  distortion_model: equidistant
  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]
  resolution: [32, 24]
"""


def png(width, height, shade):
    """A PNG of one colour."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = (b"\0" + bytes([shade, 80, 160]) * width) * height
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def write_dataset(folder):
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "images").mkdir(parents=True)
    (folder / "lidar").mkdir()
    (folder / "camera.yaml").write_text(CAMERA)
    for i in range(FRAMES):
        (folder / f"images/{i:06}.png").write_bytes(png(32, 24, 40 * i))
        (folder / f"lidar/{i:06}.bin").write_bytes(struct.pack("<8f", 1, 2, 3, 0.5, 4, 5, 6, 0.25))
    (folder / "times.txt").write_text("".join(f"{i:06} {10 + 0.1 * i} 0\n" for i in range(FRAMES)))
    poses = "".join(f"{10 + 0.1 * i} {i} 2 3 0 0 0.6 0.8\n" for i in range(FRAMES))
    (folder / "groundtruth.txt").write_text(poses)
    (folder / "lidar/poses.txt").write_text(poses)
    (folder / "imu.csv").write_text("10050000000,0.1,0.2,0.3,0,0,9.8\n10150000000,0.1,0.2,0.3,0,0,9.8\n")
    (folder / "gps.csv").write_text("t,lat,lon,height,horizontal_sigma,vertical_sigma\n10.05,-0.25,-78.5,2850,0.5,2\n")
    (folder / "barometer.csv").write_text("t [s],pressure [Pa]\n10.05,70000\n")
    (folder / "magnetometer.csv").write_text("t [s],x [uT],y [uT],z [uT]\n10.05,20,-3,40\n")
    (folder / "range.csv").write_text("t [s],range [m]\n10.05,12.5\n")


def check(read):
    topics = read["topics"]
    counts = {topic: entry["count"] for topic, entry in topics.items()}
    assert counts == {
        "/camera/image/compressed": FRAMES, "/camera/camera_info": FRAMES, "/tf": 3 * FRAMES, "/lidar": FRAMES,
        "/odometry": FRAMES,
        "/imu": 2, "/gnss": 1, "/barometer": 1, "/magnetometer": 1, "/range": 1,
    }, counts
    assert read["profile"] == "ros2" and read["messages"] == sum(counts.values()) and read["chunks"] == 1
    first = {topic: entry["first"] for topic, entry in topics.items()}
    assert first["/camera/image/compressed"]["header"] == {"stamp": {"sec": 10, "nanosec": 0}, "frame_id": "camera"}
    assert bytes(first["/camera/image/compressed"]["data"]) == png(32, 24, 0)
    info = first["/camera/camera_info"]
    assert (info["width"], info["height"], info["distortion_model"]) == (32, 24, "equidistant")
    assert info["k"] == [20, 0, 15.5, 0, 21, 11.5, 0, 0, 1] and info["d"] == [0.01, 0, 0, 0]
    moved = first["/tf"]["transforms"][0]
    assert (moved["header"]["frame_id"], moved["child_frame_id"]) == ("map", "camera")
    assert moved["transform"]["translation"] == {"x": 0, "y": 2, "z": 3}
    assert math.isclose(moved["transform"]["rotation"]["z"], 0.6) and math.isclose(moved["transform"]["rotation"]["w"], 0.8)
    cloud = first["/lidar"]
    assert [field["name"] for field in cloud["fields"]] == ["x", "y", "z", "intensity", "time", "ring"]
    step = cloud["point_step"]
    assert (cloud["width"], len(cloud["data"])) == (2, 2 * step)
    assert struct.unpack_from("<5fH", bytes(cloud["data"]), step) == (4, 5, 6, 0.25, 0, 0)
    assert first["/imu"]["angular_velocity"] == {"x": 0.1, "y": 0.2, "z": 0.3}
    assert first["/imu"]["linear_acceleration"]["z"] == 9.8
    assert (first["/gnss"]["latitude"], first["/gnss"]["altitude"]) == (-0.25, 2850)
    assert first["/gnss"]["position_covariance"][8] == 4
    assert first["/barometer"]["fluid_pressure"] == 70000
    assert math.isclose(first["/magnetometer"]["magnetic_field"]["z"], 40e-6)
    assert first["/range"]["range"] == 12.5


def main():
    tileflight, source, work = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    install(source, work, "check_mcap.mjs")
    write_dataset(work / "dataset")
    mcap = work / "flight.mcap"
    subprocess.run([tileflight, "export", work / "dataset", "--layout", "mcap", "--out", mcap, "--force", "--quiet"], check=True)
    done = subprocess.run(["node", "check_mcap.mjs", mcap], cwd=work, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    check(json.loads(done.stdout))


main()
