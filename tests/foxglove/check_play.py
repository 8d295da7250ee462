"""`tileflight play --foxglove` as Foxglove's own client (npm @foxglove/ws-protocol) sees it: all that a rendered flight's
files hold arrives, at its time, with the same bytes.

Usage: check_play.py TILEFLIGHT WORK_FOLDER
Exits with 77 (skipped) where there is no node, or npm cannot fetch the packages.
"""
import hashlib
import math
import pathlib
import signal
import subprocess
import sys

import programs


def rows(file, separator=None):
    lines = [line for line in file.read_text().splitlines() if line[0] not in "#t"]
    return [[float(word) for word in line.split(separator)] for line in lines]


def close(a, b):
    return math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-9)


def check_images(seen, flight):
    files = sorted((flight / "images").iterdir())
    images = seen["messages"]["/camera/image/compressed"]
    assert len(images) == len(files) > 30
    for message, file, (name, time, _) in zip(images, files, [line.split() for line in (flight / "times.txt").read_text().splitlines()]):
        assert file.stem == name and close(message["time"] * 1e-9, float(time))
        assert message["value"]["format"] == "jpeg" and message["value"]["header"]["frame_id"] == "camera"
        assert message["value"]["data"]["sha256"] == hashlib.sha256(file.read_bytes()).hexdigest(), file
    info = seen["messages"]["/camera/camera_info"][0]["value"]
    assert (info["width"], info["height"], info["distortion_model"]) == (160, 120, "plumb_bob"), info
    assert info["k"] == [76, 0, 79.5, 0, 76, 59.5, 0, 0, 1] and info["d"] == [0.01, 0, 0, 0, 0]
    depth = seen["messages"]["/camera/depth"]
    assert len(depth) == len(files)
    assert depth[0]["value"]["encoding"] == "32FC1" and depth[0]["value"]["step"] == 4 * 160
    assert depth[0]["value"]["data"]["bytes"] == 4 * 160 * 120


def check_poses(seen, flight):
    truth = rows(flight / "groundtruth.txt")
    to_camera = [t for m in seen["messages"]["/tf"] for t in m["value"]["transforms"] if t["child_frame_id"] == "camera"]
    assert len(to_camera) == len(truth)
    odometry = [m["value"] for m in seen["messages"]["/odometry"]]
    path = seen["messages"]["/path"][0]["value"]["poses"]
    assert len(seen["messages"]["/path"]) == 1 and len(path) == len(truth) == len(odometry)
    for row, moved, known, on_path in zip(truth, to_camera, odometry, path):
        assert moved["header"]["frame_id"] == known["header"]["frame_id"] == on_path["header"]["frame_id"] == "map"
        stamp = moved["header"]["stamp"]
        assert close(stamp["sec"] + stamp["nanosec"] * 1e-9, row[0])
        for position in (moved["transform"]["translation"], known["pose"]["pose"]["position"], on_path["pose"]["position"]):
            assert all(close(position[axis], value) for axis, value in zip("xyz", row[1:4]))
        for turned in (moved["transform"]["rotation"], known["pose"]["pose"]["orientation"], on_path["pose"]["orientation"]):
            assert all(close(turned[axis], value) for axis, value in zip("xyzw", row[4:8]))
    speed = math.hypot(*odometry[len(odometry) // 2]["twist"]["twist"]["linear"].values())
    before, after = truth[len(truth) // 2 - 1], truth[len(truth) // 2 + 1]
    assert close(speed, math.dist(before[1:4], after[1:4]) / (after[0] - before[0]))


def check_sensors(seen, flight):
    imu = rows(flight / "imu.csv", ",")
    readings = [m["value"] for m in seen["messages"]["/imu"]]
    assert len(readings) == len(imu)
    for row, reading in zip(imu, readings):
        assert all(close(reading["angular_velocity"][axis], value) for axis, value in zip("xyz", row[1:4]))
        assert all(close(reading["linear_acceleration"][axis], value) for axis, value in zip("xyz", row[4:7]))
    assert len(seen["messages"]["/lidar"]) == len(list((flight / "lidar").glob("*.ply")))
    assert [field["name"] for field in seen["messages"]["/lidar"][0]["value"]["fields"]][:3] == ["x", "y", "z"]
    pressures = [m["value"]["fluid_pressure"] for m in seen["messages"]["/barometer"]]
    assert pressures == [row[1] for row in rows(flight / "barometer.csv", ",")]
    assert len(seen["messages"]["/range"]) == len(rows(flight / "range.csv", ","))
    assert len(seen["messages"]["/magnetometer"]) == len(rows(flight / "magnetometer.csv", ","))


def check_place(seen):
    entity = seen["messages"]["/place"][0]["value"]["entities"][0]
    model = entity["models"][0]
    assert (entity["frame_id"], model["media_type"]) == ("map", "model/gltf-binary")
    assert model["data"].startswith("Z2xURg")  # "glTF"
    assert entity["metadata"] == [{"key": "attribution", "value": "Tiny Place, CC0"}], entity["metadata"]


def check_whole(tileflight, work, flight, tileset, protocol):
    arguments = ["play", flight, "--foxglove", "--port", 0, "--paused", "--rate", 4, "--epoch", 0, "--place", tileset]
    with programs.Program(tileflight, *arguments) as player:
        wish = {"set": [{"name": "paused", "value": False}], "save": str(work)}
        seen = programs.watch(work, player.said["port"], wish, protocol)
        assert player.end() == (0, []), "it ends with the dataset"
        assert sorted(player.said["topics"]) == sorted(seen["channels"]) == sorted(seen["messages"]), seen["channels"]
    assert seen["protocol"] == protocol and seen["info"]["name"] == "tileflight play"
    assert seen["statuses"] == [] and seen["clocks"] > 10
    for topic, messages in seen["messages"].items():
        times = [message["time"] for message in messages]
        assert times == sorted(times), topic
    assert programs.layout_topics("play.json") <= set(seen["channels"])
    check_images(seen, flight)
    check_poses(seen, flight)
    check_sensors(seen, flight)
    check_place(seen)


RIG = {"left": "", "right": "cameras/right", "down": "cameras/down"}  # name: folder


def check_rig(tileflight, work, rig):
    """All cameras at once: of each its pictures, lens and depth, in a frame of its name."""
    with programs.Program(tileflight, "play", rig, "--foxglove", "--port", 0, "--rate", 4, "--epoch", 0, "--paused") as player:
        wish = {"set": [{"name": "paused", "value": False}], "save": str(work)}
        seen = programs.watch(work, player.said["port"], wish, "foxglove.sdk.v1")
        assert player.end() == (0, [])
    assert programs.layout_topics("play-rig.json") <= {*seen["channels"], "/place"}
    pictures = 0
    for name, folder in RIG.items():
        files = sorted((rig / folder / "images").iterdir())
        images = seen["messages"][f"/{name}/image/compressed"]
        pictures += len(files)
        assert len(images) == len(seen["messages"][f"/{name}/camera_info"]) == len(seen["messages"][f"/{name}/depth"]) == len(files) > 10
        for message, file, row in zip(images, files, (rig / folder / "times.txt").read_text().splitlines()):
            assert close(message["time"] * 1e-9, float(row.split()[1])) and message["value"]["header"]["frame_id"] == name
            assert message["value"]["data"]["sha256"] == hashlib.sha256(file.read_bytes()).hexdigest(), file
    assert player.said["frames"] == pictures
    moving = [t for m in seen["messages"]["/tf"] for t in m["value"]["transforms"]]
    assert {(t["header"]["frame_id"], t["child_frame_id"]) for t in moving} == {("map", "left")}
    (fixed,) = seen["messages"]["/tf_static"]
    mounts = {t["child_frame_id"]: t for t in fixed["value"]["transforms"]}
    assert set(mounts) == {"right", "down", "imu"} and {t["header"]["frame_id"] for t in mounts.values()} == {"left"}
    assert mounts["right"]["transform"]["translation"] == {"x": 0.3, "y": 0, "z": 0}, mounts["right"]


def check_chosen(tileflight, rig):
    with programs.Program(tileflight, "play", "--foxglove", "--port", 0, "--camera", "right", "--camera", "down", rig) as player:
        pictures = [topic for topic in player.said["topics"] if topic.endswith("/image/compressed")]
        assert pictures == ["/right/image/compressed", "/down/image/compressed"], player.said
        assert player.stop(signal.SIGINT) == (0, [])
    done = subprocess.run([tileflight, "play", rig, "--foxglove", "--port", "0", "--camera", "up"], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "has no camera up, only left, right, down" in done.stderr, done


def check_loop(tileflight, work, flight):
    with programs.Program(tileflight, "play", flight, "--foxglove", "--port", 0, "--rate", 50, "--loop") as player:
        frames = player.said["frames"]
        seen = programs.watch(work, player.said["port"], {"topics": ["/odometry"], "counts": {"/odometry": 2 * frames}})
        times = [message["time"] for message in seen["messages"]["/odometry"]]
        assert times[:frames] == times[frames:2 * frames] == sorted(times[:frames])
        assert player.stop(signal.SIGINT) == (0, [])


def check_refusals(tileflight, work, flight):
    def refused(*arguments, code=1):
        done = subprocess.run([tileflight, "play", *map(str, arguments)], capture_output=True, text=True, check=False)
        assert done.returncode == code and done.stdout == "" and len(done.stderr.splitlines()) == 1, (arguments, done)
        return done.stderr

    assert "nothing" in refused(work / "nothing", "--foxglove", "--port", 0)
    assert "--foxglove" in refused(flight, code=2)
    assert "--rate" in refused(flight, "--foxglove", "--rate", 0, code=2)
    assert "nowhere" in refused(flight, "--foxglove", "--port", 0, "--place", work / "nowhere")
    with programs.Program(tileflight, "play", flight, "--foxglove", "--port", 0) as player:
        assert "cannot listen" in refused(flight, "--foxglove", "--port", player.said["port"])
        assert player.stop(signal.SIGTERM) == (0, []), "while it waits for a viewer"


def main():
    tileflight, work = sys.argv[1], pathlib.Path(sys.argv[2])
    programs.install(work)
    flight, tileset = programs.render_flight(tileflight, work)
    for protocol in ("foxglove.websocket.v1", "foxglove.sdk.v1"):
        check_whole(tileflight, work, flight, tileset, protocol)
    check_loop(tileflight, work, flight)
    check_refusals(tileflight, work, flight)
    rig = programs.render_rig(tileflight, work)
    check_rig(tileflight, work, rig)
    check_chosen(tileflight, rig)


main()
