"""`tileflight serve --foxglove` as Foxglove's own client sees it, compared with what an AirSim client of the same server reads.

Usage: check_serve.py TILEFLIGHT WORK_FOLDER, with PYTHONPATH=clients/python
Exits with 77 (skipped) where there is no node, or npm cannot fetch the packages.
"""
import hashlib
import math
import os
import pathlib
import sys

import programs

sys.path.insert(0, str(programs.HERE.parents[1] / "clients/python/tests"))

GROUND_M = 100.0  # of the tiny place; NED begins on it
SETTINGS = {
    "SimMode": "ComputerVision",
    "CameraDefaults": {"CaptureSettings": [{"ImageType": t, "Width": 160, "Height": 120} for t in (0, 1)]},
    "Vehicles": {"eye": {"VehicleType": "ComputerVision", "Sensors": {"scan": {
        "SensorType": 6, "Enabled": True, "NumberOfChannels": 8, "PointsPerSecond": 20000}}}},
}
TOPICS = ["/eye/front_center/image/compressed", "/eye/front_center/camera_info", "/eye/front_center/depth",
          "/eye/scan/points", "/eye/odometry", "/eye/path", "/eye/gnss", "/eye/motion", "/tf", "/tf_static", "/clock", "/place"]


def check_picture(seen, work, client, airsim):
    import numpy
    from PIL import Image

    got = numpy.asarray(Image.open(work / "_eye_front_center_image_compressed.jpeg").convert("RGB"), dtype=float)
    plain, depth = client.simGetImages([airsim.ImageRequest("front_center", airsim.ImageType.Scene, False, False),
                                        airsim.ImageRequest("front_center", airsim.ImageType.DepthPlanar, True, False)])
    true = numpy.frombuffer(bytes(plain.image_data_uint8), dtype=numpy.uint8).reshape(120, 160, 3)[:, :, ::-1]
    assert true.std() > 20, "there is something to see"
    assert numpy.abs(got - true).mean() < 3, numpy.abs(got - true).mean()
    info = seen["messages"]["/eye/front_center/camera_info"][0]["value"]
    # 90 degrees over 160 pixels; pixel centres at integers
    assert all(math.isclose(a, b, abs_tol=1e-9) for a, b in zip(info["k"], [80, 0, 79.5, 0, 80, 59.5, 0, 0, 1])), info["k"]
    image = seen["messages"]["/eye/front_center/depth"][0]["value"]
    assert (image["encoding"], image["width"], image["height"]) == ("32FC1", 160, 120)
    floats = numpy.asarray(depth.image_data_float, dtype="<f4")
    floats[floats >= 65504] = numpy.inf
    assert image["data"]["sha256"] == hashlib.sha256(floats.tobytes()).hexdigest(), "the same floats, infinite in the sky"


def check_pose(seen, client):
    pose = client.simGetVehiclePose()
    position = seen["messages"]["/eye/odometry"][0]["value"]["pose"]["pose"]["position"]
    expected = (pose.position.y_val, pose.position.x_val, GROUND_M - pose.position.z_val)
    assert all(math.isclose(position[axis], value, abs_tol=1e-4) for axis, value in zip("xyz", expected)), position
    moved = {t["child_frame_id"]: t for topic in ("/tf", "/tf_static") for m in seen["messages"][topic] for t in m["value"]["transforms"]}
    parents = {child: t["header"]["frame_id"] for child, t in moved.items()}
    assert parents["eye/odom"] == "map" and parents["eye/base_link"] == "eye/odom", parents
    assert parents["eye/front_center_optical"] == parents["eye/scan"] == "eye/base_link", parents
    assert moved["eye/base_link"]["transform"]["translation"] == position
    assert set(moved["eye/odom"]["transform"]["translation"].values()) == {0}
    motion = seen["messages"]["/eye/motion"][0]["value"]
    assert math.isclose(motion["attitude_deg"]["heading"], 0, abs_tol=1e-3) and motion["speed"] == 0
    time = seen["messages"]["/clock"][0]["value"]["clock"]
    assert time["sec"] * 10**9 + time["nanosec"] == seen["messages"]["/clock"][0]["time"]


def check_still(running_server, airsim, work):
    """While time stands still everything is sent once, and is what a client reads."""
    with running_server.RunningServer(SETTINGS, "--foxglove", "--foxglove-port", "0") as server:
        client = server.client()
        client.simSetVehiclePose(airsim.Pose(airsim.Vector3r(5, 1, -4), airsim.to_quaternion(0, 0, 0)), True)
        wish = {"topics": TOPICS, "counts": {topic: 1 for topic in TOPICS}, "save": str(work)}
        seen = programs.watch(work, server.listening["foxglove_port"], wish, "foxglove.sdk.v1")
        assert seen["protocol"] == "foxglove.sdk.v1" and seen["info"]["name"] == "tileflight serve"
        assert set(TOPICS) < set(seen["channels"]) and "/eye/back_center/depth" in seen["channels"]
        check_picture(seen, work, client, airsim)
        check_pose(seen, client)
        assert seen["messages"]["/place"][0]["value"]["entities"][0]["models"][0]["data"].startswith("Z2xURg")
        scan = seen["messages"]["/eye/scan/points"][0]["value"]
        assert scan["header"]["frame_id"] == "eye/scan" and scan["width"] > 100
        client.close()
        code, _, err = server.stop()
        assert (code, err) == (0, ""), (code, err)


def check_flight(running_server, work):
    """A drone takes off in wall-clock time, watched."""
    settings = {"SimMode": "Multirotor", "StepOnDemand": False}
    with running_server.RunningServer(settings, "--foxglove", "--foxglove-port", "0") as server:
        client = server.client()
        client.enableApiControl(True)
        client.armDisarm(True)
        client.takeoffAsync()
        wish = {"topics": ["/SimpleFlight/motion", "/SimpleFlight/path"], "counts": {"/SimpleFlight/motion": 60, "/SimpleFlight/path": 2}}
        seen = programs.watch(work, server.listening["foxglove_port"], wish)
        assert programs.layout_topics("serve.json") <= set(seen["channels"])
        motions = seen["messages"]["/SimpleFlight/motion"]
        heights = [m["value"]["position"]["z"] - GROUND_M for m in motions]
        assert heights[-1] > heights[0] + 0.3, heights
        times = [m["time"] for m in motions]
        assert times == sorted(times) and times[-1] > times[0]
        assert len(seen["messages"]["/SimpleFlight/path"][-1]["value"]["poses"]) >= 2


def main():
    work = pathlib.Path(sys.argv[2])
    os.environ["TILEFLIGHT_BINARY"] = sys.argv[1]
    programs.install(work)
    try:
        import running_server
        import tileflight_airsim as airsim
    except ImportError as missing:
        programs.npm_packages.skip(str(missing))
    check_still(running_server, airsim, work)
    check_flight(running_server, work)


main()
