"""What the tests of this folder share: the foreign participant, its topics' names, and CDR as Python sees it."""
import json
import os
import pathlib
import struct
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "foxglove"))
import programs  # noqa: E402,F401

os.environ.pop("CYCLONEDDS_URI", None)
os.environ.pop("ROS_DOMAIN_ID", None)
DOMAIN = 1 + os.getpid() % 99  # not those of unit tests, which begin at 100


def arguments():
    """(tileflight, work folder, foreign participant); ends the test as skipped where there is none."""
    tileflight, work, peer = sys.argv[1], pathlib.Path(sys.argv[2]), sys.argv[3]
    if not peer:
        print("skipped: Fast DDS (libfastrtps-dev) is not installed")
        sys.exit(77)
    work.mkdir(parents=True, exist_ok=True)
    return tileflight, work, peer


def dds_type(name):
    """sensor_msgs/msg/Imu -> sensor_msgs::msg::dds_::Imu_"""
    *folders, last = name.split("/")
    return "::".join([*folders, "dds_", last + "_"])


def start(peer, *words):
    return subprocess.Popen([peer, str(DOMAIN), *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def result(process):
    out, err = process.communicate(timeout=100)
    assert process.returncode == 0, err
    return json.loads(out)


def ask(peer, *words):
    return result(start(peer, *words))


def wish(topic, name, count, reliable=True, latched=False):
    """Words for `read`."""
    return ["rt" + topic, dds_type(name), "reliable" if reliable else "best_effort", "latched" if latched else "volatile", count]


def files(folder, number):
    """The messages of a topic by its number among the wishes, in the order of their coming."""
    found = sorted(folder.glob(f"{number}-*.cdr"), key=lambda f: int(f.stem.split("-")[1]))
    return [f.read_bytes() for f in found]


class Cdr:
    """Reads a message, little-endian."""

    def __init__(self, data):
        assert data[:4] == b"\0\1\0\0", data[:4]
        self.body, self.at = data[4:], 0

    def number(self, kind):
        size = struct.calcsize(kind)
        self.at += -self.at % size
        value, = struct.unpack_from("<" + kind, self.body, self.at)
        self.at += size
        return value

    def numbers(self, kind, count):
        return [self.number(kind) for _ in range(count)]

    def text(self):
        size = self.number("I")
        value = self.body[self.at:self.at + size - 1].decode()
        self.at += size
        return value

    def header(self):
        return self.number("i") * 10**9 + self.number("I"), self.text()


def cdr(*parts):
    """A message of doubles, 32-bit numbers (int), 8-bit ones (bool) and texts."""
    body = b""
    for part in parts:
        kind = {float: "d", int: "I", bool: "B"}.get(type(part))
        if kind is None:
            body += b"\0" * (-len(body) % 4) + struct.pack("<I", len(part) + 1) + part.encode() + b"\0"
        else:
            body += b"\0" * (-len(body) % struct.calcsize(kind)) + struct.pack("<" + kind, part)
    return b"\0\1\0\0" + body


def serve(tileflight, work, settings):
    """`serve --ros2` of the tiny place, as a program to be used with `with`."""
    (work / "settings.json").write_text(json.dumps(settings))
    return programs.Program(tileflight, "serve", programs.tiny_place(work), "--settings", work / "settings.json", "--port", 0,
                            "--ros2", "--domain", DOMAIN, "--ros2-rate", 30)
