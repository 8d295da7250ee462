"""What the tests of this folder share: npm's packages, a rendered flight, programs that run for as long as a with block."""
import json
import pathlib
import signal
import socket
import struct
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import npm_packages  # noqa: E402

CAMERA = """cam0:
  camera_model: pinhole
  intrinsics: [76.0, 76.0, 79.5, 59.5]
  distortion_model: radtan
  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]
  resolution: [160, 120]
  T_cam_imu: [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
"""
FLIGHT = """camera: camera.yaml
fps: 10
waypoints:
  - {position: [-15, -10, 125], yaw_deg: 30, pitch_deg: -40}
  - {position: [15, 10, 128], yaw_deg: 60, pitch_deg: -50}
speed_m_s: 20
sensors:
  imu: {rate_hz: 100}
  lidar: {preset: vlp-16}
  barometer: {}
  magnetometer: {declination_deg: 0, inclination_deg: 60, strength_ut: 45}
  range_finder: {}
"""


def install(work):
    """The packages of package-lock.json, with the viewer beside them."""
    npm_packages.install(HERE, work, "watch.mjs")


def tiny_place(work):
    sys.path.insert(0, str(HERE.parents[1] / "clients/python/tests"))
    import tiny_place as place

    return place.write(work / "place")


def render_flight(tileflight, work):
    """A flight over the tiny place, with depth and all sensors; returns dataset and tileset."""
    tileset = tiny_place(work)
    (work / "camera.yaml").write_text(CAMERA)
    (work / "flight.yaml").write_text(FLIGHT)
    subprocess.run([tileflight, "render", tileset, "--flight", work / "flight.yaml", "--out", work / "flight",
                    "--depth", "--force", "--quiet"], check=True)
    return work / "flight", tileset


def render_rig(tileflight, work):
    """The same flight by three cameras, of which one takes every second picture, with depth and an IMU."""
    tileset = tiny_place(work)
    (work / "camera.yaml").write_text(CAMERA)
    cameras = """cameras:
  - {name: left, camera: camera.yaml}
  - {name: right, camera: camera.yaml, position: [0.3, 0, 0]}
  - {name: down, camera: camera.yaml, pitch_deg: -60, fps: 5}
"""
    flight = FLIGHT.replace("camera: camera.yaml\n", cameras)
    (work / "rig.yaml").write_text(flight[:flight.index("  lidar")])
    subprocess.run([tileflight, "render", tileset, "--flight", work / "rig.yaml", "--out", work / "rig", "--depth",
                    "--force", "--quiet"], check=True)
    return work / "rig"


class Program:
    """The program with these arguments and --json; `said` is the object that it prints once it listens."""

    def __init__(self, tileflight, *arguments):
        self.process = subprocess.Popen([tileflight, *map(str, arguments), "--json"], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True)

    def __enter__(self):
        lines = []
        for line in self.process.stdout:
            lines.append(line)
            if line.startswith("}"):
                self.said = json.loads("".join(lines))
                return self
        raise RuntimeError("the program did not start: " + self.process.stderr.read())

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()

    def memory_mb(self):
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024

    def stop(self, with_signal=signal.SIGINT):
        """(exit code, lines on stderr)"""
        self.process.send_signal(with_signal)
        return self.end()

    def end(self):
        _, err = self.process.communicate(timeout=60)
        return self.process.returncode, err.splitlines()


def watch(work, port, wish, protocol="foxglove.websocket.v1"):
    """What the viewer saw."""
    done = subprocess.run(["node", "watch.mjs", f"ws://127.0.0.1:{port}", protocol, json.dumps(wish)], cwd=work,
                          capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def layout_topics(name):
    """The topics that a layout of examples/foxglove shows."""
    panels = json.loads((HERE.parents[1] / "examples/foxglove" / name).read_text())["configById"].values()
    found = set()
    for panel in panels:
        found |= set(panel.get("topics", {})) | {topic for key, topic in panel.get("imageMode", {}).items() if key.endswith("Topic")}
        found |= {path["value"].split(".")[0] for path in panel.get("paths", [])}
    return found


def connect(port, protocol="foxglove.websocket.v1", receive_buffer=None):
    """(a raw socket, after the handshake unless `protocol` is None; whether the server accepted it)"""
    client = socket.socket()
    client.settimeout(20)
    if receive_buffer:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    client.connect(("127.0.0.1", port))
    if not protocol:
        return client, False
    client.sendall((f"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                    f"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
                    f"Sec-WebSocket-Protocol: {protocol}\r\n\r\n").encode())
    return client, client.recv(12) == b"HTTP/1.1 101"


def frame(payload, first=0x81, size=None):
    """A frame of a client, masked with zeros (RFC 6455, section 5.2); `size` may lie."""
    return struct.pack(">BBQ4x", first, 0xFF, len(payload) if size is None else size) + payload
