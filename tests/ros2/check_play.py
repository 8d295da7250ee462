"""`tileflight play --ros2` as Fast DDS sees it: topics under ROS 2's names, and of each message the bytes that the MCAP
export of the same dataset holds.

Usage: check_play.py TILEFLIGHT WORK_FOLDER FAST_DDS_PEER
Exits with 77 (skipped) where there is no Fast DDS.
"""
import collections
import shutil
import signal
import struct
import subprocess

import peers
from peers import programs

TYPES = {
    "/camera/image/compressed": "sensor_msgs/msg/CompressedImage", "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/camera/depth": "sensor_msgs/msg/Image", "/tf": "tf2_msgs/msg/TFMessage", "/imu": "sensor_msgs/msg/Imu",
    "/lidar": "sensor_msgs/msg/PointCloud2", "/barometer": "sensor_msgs/msg/FluidPressure",
    "/magnetometer": "sensor_msgs/msg/MagneticField", "/range": "sensor_msgs/msg/Range",
    "/odometry": "nav_msgs/msg/Odometry", "/path": "nav_msgs/msg/Path", "/clock": "rosgraph_msgs/msg/Clock",
    "/tf_static": "tf2_msgs/msg/TFMessage"}
LATCHED = {"/tf_static", "/path"}


def mcap_messages(file):
    """{topic: messages} of an MCAP file whose chunks are not compressed (https://mcap.dev/spec)."""
    channels, messages = {}, collections.defaultdict(list)

    def records(data):
        at = 0
        while at < len(data):
            kind, size = struct.unpack_from("<BQ", data, at)
            yield kind, data[at + 9:at + 9 + size]
            at += 9 + size

    def text(data, at):
        size, = struct.unpack_from("<I", data, at)
        return data[at + 4:at + 4 + size].decode(), at + 4 + size

    def walk(data):
        for kind, content in records(data):
            if kind == 6:  # chunk: times, size, checksum, compression, records
                compression, at = text(content, 28)
                assert compression == "", compression
                walk(content[at + 8:])
            elif kind == 4:
                channels[struct.unpack_from("<H", content)[0]] = text(content, 4)[0]
            elif kind == 5:
                messages[channels[struct.unpack_from("<H", content)[0]]].append(content[22:])

    walk(file.read_bytes()[8:-8])
    return messages


def check_discovery(peer):
    found = peers.ask(peer, "discover", 3)
    assert found["participants"] == [{"status": 0, "user_data": "enclave=/;"}], found["participants"]
    writers = {one["topic"]: one for one in found["writers"]}
    expected = {"rt" + topic: peers.dds_type(name) for topic, name in TYPES.items()}
    expected["ros_discovery_info"] = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"
    assert {topic: one["type"] for topic, one in writers.items()} == expected, writers
    assert all(one["reliable"] for one in writers.values()), "they serve readers of both kinds"
    assert {topic for topic, one in writers.items() if one["latched"]} == {"rt/path", "rt/tf_static", "ros_discovery_info"}
    assert found["readers"] == [], "nobody commands a dataset"


def check_bytes(read, exported):
    """With up to three zeros of padding at the end; playing begins with the first reader, and others may come after some
    messages."""
    compared = 0
    for number, topic in enumerate(TYPES):
        messages = peers.files(read, number)
        if topic not in exported or topic == "/tf":
            continue
        known = exported[topic]
        assert 0.9 * len(known) - 2 <= len(messages) <= len(known), (topic, len(messages), len(known))
        known = known[len(known) - len(messages):]
        for ours, theirs in zip(messages, known):
            assert ours[:len(theirs)] == theirs and len(ours) - len(theirs) < 4 and not any(ours[len(theirs):]), topic
            compared += 1
    assert compared > 700, compared


def check_transforms(read, exported):
    """Camera to IMU is sent once, apart from the camera's poses."""
    topics = list(TYPES)
    moving = [m.rstrip(b"\0") for m in peers.files(read, topics.index("/tf"))]
    fixed = peers.files(read, topics.index("/tf_static"))
    assert len(fixed) == 1
    message = peers.Cdr(fixed[0])
    assert message.number("I") == 1
    _, parent = message.header()
    assert (parent, message.text()) == ("camera", "imu")
    assert message.numbers("d", 3)[0] == 0.1, "T_cam_imu"
    known = [m.rstrip(b"\0") for m in exported["/tf"] if b"\0imu\0" not in m]
    assert len(moving) > 0.9 * len(known) and moving == known[len(known) - len(moving):]


def check_whole(tileflight, work, peer, flight):
    """Readers of both kinds; best effort may lose some, so only the reliable ones are compared whole."""
    subprocess.run([tileflight, "export", flight, "--layout", "mcap", "--out", work / "flight.mcap", "--force", "--quiet"], check=True)
    exported = mcap_messages(work / "flight.mcap")
    read = work / "read"
    shutil.rmtree(read, ignore_errors=True)
    read.mkdir()
    with programs.Program(tileflight, "play", flight, "--ros2", "--domain", peers.DOMAIN, "--rate", 2) as player:
        assert sorted(player.said["topics"]) == sorted(TYPES) and "port" not in player.said, player.said
        check_discovery(peer)
        words = [word for topic, name in TYPES.items()
                 for word in peers.wish(topic, name, 100000, latched=topic in LATCHED)]
        reader = peers.start(peer, "read", read, 12, *words)
        assert player.end() == (0, []), "it ends with the dataset"
        seen = peers.result(reader)
    assert seen["rt/clock"]["count"] > 500, seen["rt/clock"]["count"]
    check_bytes(read, exported)
    check_transforms(read, exported)


def check_late(tileflight, peer, flight):
    """Who comes in the middle gets what is latched, and the sensor-data profile gets images."""
    with programs.Program(tileflight, "play", flight, "--ros2", "--domain", peers.DOMAIN, "--loop") as player:
        peers.ask(peer, "read", "-", 20, *peers.wish("/clock", TYPES["/clock"], 200, reliable=False))
        late = peers.ask(peer, "read", "-", 20, *peers.wish("/tf_static", TYPES["/tf_static"], 1, latched=True),
                         *peers.wish("/path", TYPES["/path"], 1, latched=True),
                         *peers.wish("/camera/image/compressed", TYPES["/camera/image/compressed"], 10, reliable=False),
                         *peers.wish("/lidar", TYPES["/lidar"], 5, reliable=False))
        assert all(one["count"] > 0 for one in late.values()), late
        assert player.stop(signal.SIGINT) == (0, [])


def check_both(tileflight, work, peer, flight):
    arguments = ["play", flight, "--ros2", "--domain", peers.DOMAIN, "--foxglove", "--port", 0]
    with programs.Program(tileflight, *arguments) as player:
        assert player.said["port"] > 0 and player.said["ros2"]["domain"] == peers.DOMAIN, player.said
        seen = peers.ask(peer, "read", "-", 20, *peers.wish("/odometry", TYPES["/odometry"], 20))
        assert seen["rt/odometry"]["count"] >= 20
        assert player.stop(signal.SIGTERM) == (0, [])


def check_rig(tileflight, work, peer):
    """All cameras at once, and one /tf_static with the frames of all."""
    rig = programs.render_rig(tileflight, work)
    cameras = ("left", "right", "down")
    images = {f"/{name}/image/compressed": "sensor_msgs/msg/CompressedImage" for name in cameras}
    infos = {f"/{name}/camera_info": "sensor_msgs/msg/CameraInfo" for name in cameras}
    topics = {**images, **infos, "/tf_static": TYPES["/tf_static"]}
    read = work / "read_rig"
    shutil.rmtree(read, ignore_errors=True)
    read.mkdir()
    with programs.Program(tileflight, "play", rig, "--ros2", "--domain", peers.DOMAIN, "--rate", 2) as player:
        assert set(topics) < set(player.said["topics"]), player.said
        words = [word for topic, name in topics.items()
                 for word in peers.wish(topic, name, 100000, latched=topic in LATCHED)]
        reader = peers.start(peer, "read", read, 12, *words)
        assert player.end() == (0, []), "it ends with the dataset"
        seen = peers.result(reader)
    for name in cameras:
        folder = rig if name == "left" else rig / "cameras" / name
        files = sorted((folder / "images").iterdir())
        known = {file.read_bytes() for file in files}
        came = peers.files(read, list(topics).index(f"/{name}/image/compressed"))
        # Playing begins with the first reader: others may come after some messages.
        assert 0.9 * len(files) - 2 <= len(came) <= len(files), (name, len(came), len(files))
        for data in came:
            message = peers.Cdr(data)
            _, frame = message.header()
            assert frame == name and any(data.rstrip(b"\0").endswith(file.rstrip(b"\0")) for file in known), name
        assert seen[f"rt/{name}/camera_info"]["count"] >= 0.9 * len(files) - 2, seen
    fixed = peers.files(read, list(topics).index("/tf_static"))
    assert len(fixed) == 1
    message = peers.Cdr(fixed[0])
    frames = []
    for _ in range(message.number("I")):
        _, parent = message.header()
        frames.append((parent, message.text()))
        message.numbers("d", 7)
    assert sorted(frames) == [("left", "down"), ("left", "imu"), ("left", "right")], frames


def main():
    tileflight, work, peer = peers.arguments()
    flight, _ = programs.render_flight(tileflight, work)
    check_whole(tileflight, work, peer, flight)
    check_late(tileflight, peer, flight)
    check_both(tileflight, work, peer, flight)
    check_rig(tileflight, work, peer)


main()
