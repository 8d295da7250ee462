"""`tileflight serve --ros2` as Fast DDS sees it: all topics of a vehicle, its orders and services; how long an image is on
its way, which is printed.

Usage: check_serve.py TILEFLIGHT WORK_FOLDER FAST_DDS_PEER, with PYTHONPATH=clients/python
Exits with 77 (skipped) where there is no Fast DDS.
"""
import math
import shutil
import signal
import sys
import time

import peers

SETTINGS = {
    "SimMode": "Multirotor",
    "CameraDefaults": {"CaptureSettings": [{"ImageType": t, "Width": 640, "Height": 480} for t in (0, 1)]},
    "Vehicles": {"drone": {"VehicleType": "SimpleFlight", "Sensors": {
        "imu": {"SensorType": 2, "Enabled": True},
        "scan": {"SensorType": 6, "Enabled": True, "NumberOfChannels": 8, "PointsPerSecond": 20000}}}},
}
TYPES = {
    "/drone/front_center/image": "sensor_msgs/msg/Image",
    "/drone/front_center/image/compressed": "sensor_msgs/msg/CompressedImage",
    "/drone/front_center/camera_info": "sensor_msgs/msg/CameraInfo", "/drone/front_center/depth": "sensor_msgs/msg/Image",
    "/drone/scan/points": "sensor_msgs/msg/PointCloud2", "/drone/imu/data_raw": "sensor_msgs/msg/Imu",
    "/drone/odometry": "nav_msgs/msg/Odometry", "/drone/path": "nav_msgs/msg/Path",
    "/drone/gnss": "sensor_msgs/msg/NavSatFix", "/tf": "tf2_msgs/msg/TFMessage", "/clock": "rosgraph_msgs/msg/Clock",
    "/tf_static": "tf2_msgs/msg/TFMessage"}


def check_discovery(peer):
    found = peers.ask(peer, "discover", 3)
    writers = {one["topic"]: one["type"] for one in found["writers"]}
    for topic, name in TYPES.items():
        assert writers["rt" + topic] == peers.dds_type(name), topic
    readers = {one["topic"]: one for one in found["readers"]}
    assert readers["rt/drone/cmd_vel"]["type"] == "geometry_msgs::msg::dds_::Twist_"
    assert readers["rt/drone/goal_pose"]["type"] == "geometry_msgs::msg::dds_::PoseStamped_"
    for name, kind in (("reset", "Trigger"), ("step", "Trigger"), ("pause", "SetBool")):
        request = readers[f"rq/tileflight/{name}Request"]
        assert request["type"] == f"std_srvs::srv::dds_::{kind}_Request_" and request["user_data"].startswith("serviceid=")
        assert writers[f"rr/tileflight/{name}Reply"] == f"std_srvs::srv::dds_::{kind}_Response_"


def check_messages(peer, work):
    """One of each, from a vehicle that stands on the ground."""
    read = work / "read"
    shutil.rmtree(read, ignore_errors=True)
    read.mkdir()
    words = [word for topic, name in TYPES.items() for word in peers.wish(topic, name, 1, latched=topic == "/tf_static")]
    seen = peers.ask(peer, "read", read, 30, *words)
    assert all(one["count"] > 0 for one in seen.values()), seen
    first = {topic: peers.Cdr(peers.files(read, number)[0]) for number, topic in enumerate(TYPES)}
    image = first["/drone/front_center/image"]
    stamp, frame = image.header()
    assert frame == "drone/front_center_optical" and stamp > 0
    assert image.numbers("I", 2) == [480, 640] and image.text() == "rgb8"
    assert image.number("B") == 0 and image.numbers("I", 2) == [3 * 640, 3 * 640 * 480]
    depth = first["/drone/front_center/depth"]
    depth.header()
    assert depth.numbers("I", 2) == [480, 640] and depth.text() == "32FC1"
    imu = first["/drone/imu/data_raw"]
    assert imu.header()[1] == "drone/imu"
    numbers = imu.numbers("d", 4 + 9 + 3 + 9 + 3)
    assert numbers[4] == -1, "REP 145: no orientation"
    assert abs(numbers[27] - 9.8) < 0.3, "at rest gravity is felt upwards"
    assert first["/drone/gnss"].header()[1] == "drone/base_link"
    assert first["/drone/odometry"].header()[1] == "drone/odom" and first["/drone/odometry"].text() == "drone/base_link"
    fixed = first["/tf_static"]
    pairs = set()
    for _ in range(fixed.number("I")):
        parent = fixed.header()[1]
        pairs.add((parent, fixed.text()))
        fixed.numbers("d", 7)
    assert {("map", "drone/odom"), ("drone/base_link", "drone/front_center_optical"), ("drone/base_link", "drone/scan"),
            ("drone/base_link", "drone/imu")} <= pairs, pairs


def position(peer, work):
    folder = work / "position"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    peers.ask(peer, "read", folder, 20, *peers.wish("/drone/odometry", TYPES["/drone/odometry"], 1))
    message = peers.Cdr(peers.files(folder, 0)[-1])
    message.header()
    message.text()
    return message.numbers("d", 3)


def check_orders(peer, work):
    """Up at 2 m/s for some seconds, then to a goal; a writer knows its reader before the reader knows it, so that first
    messages may be lost."""
    before = position(peer, work)
    up = work / "up.cdr"
    up.write_bytes(peers.cdr(0.0, 0.0, 2.0, 0.0, 0.0, 0.0))
    peers.ask(peer, "write", "rt/drone/cmd_vel", "geometry_msgs::msg::dds_::Twist_", up, 50, 100)
    after = position(peer, work)
    assert after[2] - before[2] > 2 and math.dist(before[:2], after[:2]) < 1, (before, after)
    wanted = [after[0] + 3, after[1] - 2, after[2] + 1]
    goal = work / "goal.cdr"
    goal.write_bytes(peers.cdr(0, 0, "map", *wanted, 0.0, 0.0, 0.0, 1.0))
    peers.ask(peer, "write", "rt/drone/goal_pose", "geometry_msgs::msg::dds_::PoseStamped_", goal, 10, 200)
    end = time.monotonic() + 30
    while math.dist(position(peer, work), wanted) > 0.7:
        assert time.monotonic() < end, (position(peer, work), wanted)


def call(peer, work, name, kind, request, *more):
    file = work / "request.cdr"
    file.write_bytes(request)
    return peers.ask(peer, "call", "/tileflight/" + name, f"std_srvs::srv::dds_::{kind}_Request_",
                     f"std_srvs::srv::dds_::{kind}_Response_", file, *more)


def check_services(peer, work):
    def answer(*arguments):
        reply = peers.Cdr(bytes.fromhex(call(peer, work, *arguments)["reply"]))
        assert reply.numbers("Q", 1) + reply.numbers("q", 1) == [0x1122334455667788, 7]
        return reply.number("B"), reply.text()

    assert answer("pause", "SetBool", peers.cdr(True)) == (1, "paused")
    steps = [answer("step", "Trigger", peers.cdr(False)) for _ in range(2)]
    assert all(done == 1 for done, _ in steps) and steps[0][1] != steps[1][1], steps
    assert answer("pause", "SetBool", peers.cdr(False)) == (1, "running")
    assert answer("reset", "Trigger", peers.cdr(False))[0] == 1
    assert call(peer, work, "reset", "Trigger", peers.cdr(False), "plain") == {"error": "no reply"}, "rmw_fastrtps_cpp"


def print_latency(peer):
    """Not a check: the machine may be busy."""
    seen = peers.ask(peer, "read", "-", 10, *peers.wish("/drone/front_center/image", TYPES["/drone/front_center/image"], 100))
    got = seen["rt/drone/front_center/image"]
    latencies = sorted(got["latencies_ms"])
    seconds = got["times_s"][-1] - got["times_s"][0]
    print(f"640 x 480 rgb8: {got['count']} images, {(got['count'] - 1) / seconds:.1f} a second, image ready to received: "
          f"median {latencies[len(latencies) // 2]:.2f} ms, 95 % {latencies[int(0.95 * len(latencies))]:.2f} ms, "
          f"worst {latencies[-1]:.2f} ms")


def main():
    tileflight, work, peer = peers.arguments()
    with peers.serve(tileflight, work, SETTINGS) as server:
        assert server.said["ros2"] == {"domain": peers.DOMAIN, "network": "127.0.0.1 alone"}, server.said
        check_discovery(peer)
        check_messages(peer, work)
        check_orders(peer, work)
        check_services(peer, work)
        print_latency(peer)
        code, lines = server.stop(signal.SIGINT)
        assert code == 0 and len([x for x in lines if "rmw_cyclonedds_cpp" in x]) == 1, lines
    sys.exit(0)


main()
