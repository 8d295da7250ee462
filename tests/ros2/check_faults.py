"""`serve --ros2` with peers that vanish, stop reading, or send what is no message: one line each, and it serves on in
bounded memory.

Usage: check_faults.py TILEFLIGHT WORK_FOLDER FAST_DDS_PEER, with PYTHONPATH=clients/python
Exits with 77 (skipped) where there is no Fast DDS.
"""
import math
import random
import signal
import socket
import subprocess
import time

import peers

SETTINGS = {
    "SimMode": "Multirotor",
    "CameraDefaults": {"CaptureSettings": [{"ImageType": t, "Width": 640, "Height": 480} for t in (0, 1)]},
    "Vehicles": {"drone": {"VehicleType": "SimpleFlight"}},
}
IMAGE = "/drone/front_center/image"


def alive(peer):
    got = peers.ask(peer, "read", "-", 30, *peers.wish("/clock", "rosgraph_msgs/msg/Clock", 3))
    assert got["rt/clock"]["count"] >= 3, got


def check_malformed(peer, work):
    """From five writers at once."""
    writers = []
    for name, data in {"nan": peers.cdr(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0), "cut": peers.cdr(1.0, 2.0)[:17],
                       "empty": b"\0\1\0\0", "large": b"\0\1\0\0" + b"x" * 300_000,
                       "encoding": b"\0\x0b\0\0" + b"x" * 48}.items():
        file = work / f"{name}.cdr"
        file.write_bytes(data)
        writers.append(peers.start(peer, "write", "rt/drone/cmd_vel", "geometry_msgs::msg::dds_::Twist_", file, 20, 20))
    for writer in writers:
        assert "written" in peers.result(writer)
    alive(peer)


def check_slow_reader(server, peer):
    """A reliable reader that stops, with images of a megabyte 30 times a second: others get them, memory stays."""
    slow = peers.start(peer, "read", "-", 100, *peers.wish(IMAGE, "sensor_msgs/msg/Image", 100000))
    time.sleep(3)
    slow.send_signal(signal.SIGSTOP)
    time.sleep(2)
    before = server.memory_mb()
    got = peers.ask(peer, "read", "-", 30, *peers.wish(IMAGE, "sensor_msgs/msg/Image", 60))
    assert got["rt" + IMAGE]["count"] >= 60, got["rt" + IMAGE]["count"]
    assert server.memory_mb() < before + 60, (before, server.memory_mb())
    slow.kill()  # without a goodbye
    slow.communicate()
    alive(peer)


def check_vanishing(server, peer):
    """Many that come one after the other and go without a goodbye."""
    for _ in range(3):
        many = [peers.start(peer, "read", "-", 100, *peers.wish(IMAGE, "sensor_msgs/msg/Image", 100000, reliable=r)) for r in (True, False)]
        time.sleep(1.5)
        for one in many:
            one.kill()
            one.communicate()
    alive(peer)


def check_noise(peer):
    """Datagrams that are no RTPS, and some that begin as if they were."""
    chance = random.Random(1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for port in range(7410 + 250 * peers.DOMAIN, 7416 + 250 * peers.DOMAIN):
            for _ in range(300):
                data = chance.randbytes(chance.randrange(200))
                sender.sendto(data if chance.random() < 0.5 else b"RTPS\2\1\1\x10" + data, ("127.0.0.1", port))
    alive(peer)


def check_refusals(tileflight, work):
    def refused(*arguments, code=1):
        done = subprocess.run([tileflight, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=60)
        assert done.returncode == code and done.stdout == "" and len(done.stderr.splitlines()) == 1, (arguments, done)
        return done.stderr

    place = work / "place/tileset.json"
    assert "nothing0" in refused("serve", place, "--port", 0, "--ros2", "--ros2-interface", "nothing0")
    assert "no name or address" in refused("serve", place, "--port", 0, "--ros2", "--ros2-interface", "<x>", "--quiet")
    assert "232" in refused("serve", place, "--ros2", "--domain", 233, code=2)
    assert "--ros2" in refused("play", work, code=2)


def main():
    tileflight, work, peer = peers.arguments()
    with peers.serve(tileflight, work, SETTINGS) as server:
        check_malformed(peer, work)
        check_noise(peer)
        check_slow_reader(server, peer)
        check_vanishing(server, peer)
        code, lines = server.stop(signal.SIGINT)
        assert code == 0, lines
    for why in ("not finite", "cut off", "not encoded in CDR", "too large"):
        assert len([line for line in lines if why in line]) in (1, 2), (why, lines)
    assert len(lines) < 12, lines
    check_refusals(tileflight, work)


main()
