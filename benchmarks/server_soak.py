#!/usr/bin/env python3
"""Mixed random calls of many clients at `tileflight serve`, of which some are killed at random and some send nonsense.

    PYTHONPATH=clients/python benchmarks/server_soak.py --binary build/release/bin/tileflight --minutes 60 --clients 8 --all

--all: with autopilots that fly two more vehicles by ArduPilot's and PX4's interfaces (and are killed and started again, too), a viewer
that watches all there is, and ROS 2 open to nodes on this machine (domain 87).

Fails unless the server lives, every answer is well formed, no call is stuck at the end, and the server's memory after
the first quarter of the time stays the same within --memory-tolerance.
"""
import argparse
import json
import math
import os
import pathlib
import random
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "clients/python"), str(ROOT / "clients/python/tests"), str(ROOT / "tests/foxglove")]
import tileflight_airsim as airsim  # noqa: E402
import tiny_place  # noqa: E402

VEHICLES = ("Drone1", "Drone2")
PATIENCE_S = 900  # of a client, on a machine that may be busy with other things, or stopped for minutes
LIDAR = {"SensorType": 6, "Enabled": True, "NumberOfChannels": 16, "PointsPerSecond": 20000, "Range": 60}
SETTINGS = {
    "SettingsVersion": 1.2, "SimMode": "Multirotor", "ClockSpeed": 5,
    "CameraDefaults": {"CaptureSettings": [{"ImageType": kind, "Width": 64, "Height": 48} for kind in (0, 1, 5)]},
    "Vehicles": {name: {"VehicleType": "SimpleFlight", "X": 0, "Y": 4 * i, "Z": 0, "Sensors": {"Lidar1": LIDAR}}
                 for i, name in enumerate(VEHICLES)},
}


FLOWN = {"Copter": {"VehicleType": "ArduCopter", "ControlPort": 0, "Y": -8},
         "Px4": {"VehicleType": "PX4Multirotor", "TcpPort": 0, "X": 8, "OpticalFlow": True, "VisionOdometry": "TruthWithNoise"}}
AUTOPILOT_RATE = 400
HIL_ACTUATOR_CONTROLS, HIL_SENSOR, HIL_STATE_QUATERNION = 93, 107, 115  # messages of MAVLink's common set
HIL_ACTUATOR_CONTROLS_CRC_EXTRA = 47
ARMED = 129


def hostile_number(rng):
    return rng.choice([0, -1, 1, math.nan, math.inf, -math.inf, 1e300, 3e38, 2**31 - 1, -5, 0.1, 1e-9])


def hostile_vector(rng):
    return airsim.Vector3r(*(hostile_number(rng) for _ in range(3)))


def pictures(client, rng, vehicle):
    requests = [airsim.ImageRequest("0", rng.choice((0, 1, 5)), rng.random() < 0.5, rng.random() < 0.5)
                for _ in range(rng.randint(1, 3))]
    for request, image in zip(requests, client.simGetImages(requests, vehicle)):
        size = len(image.image_data_float) if request.pixels_as_float else len(image.image_data_uint8)
        if request.pixels_as_float:
            assert size == image.width * image.height, size
        elif request.compress:
            assert image.image_data_uint8[:4] == b"\x89PNG"
        else:
            assert size == 3 * image.width * image.height, size


def fly(client, rng, vehicle):
    client.enableApiControl(True, vehicle)
    client.armDisarm(True, vehicle)
    kind = rng.randrange(5)
    if kind == 0:
        answer = client.takeoffAsync(5, vehicle)
    elif kind == 1:
        answer = client.moveToPositionAsync(rng.uniform(-9, 9), rng.uniform(-9, 9), rng.uniform(-9, -2), 5, 10,
                                            vehicle_name=vehicle)
    elif kind == 2:
        path = [airsim.Vector3r(rng.uniform(-9, 9), rng.uniform(-9, 9), -5) for _ in range(rng.randint(0, 4))]
        answer = client.moveOnPathAsync(path, 3, 10, vehicle_name=vehicle)
    elif kind == 3:
        answer = client.moveByVelocityAsync(1, 0, -0.2, rng.choice((0, 1, 1000)), vehicle_name=vehicle)
    else:
        answer = client.hoverAsync(vehicle)
    if rng.random() < 0.7:
        client.cancelLastTask(vehicle)
        assert answer.get() in (True, False)
    else:
        assert client.getMultirotorState(vehicle).landed_state in (0, 1)


def sense(client, rng, vehicle):
    assert client.getImuData("", vehicle).time_stamp > 0
    assert len(client.getLidarData("", vehicle).point_cloud) % 3 == 0
    assert client.getGpsData("", vehicle).gnss.fix_type in (0, 1, 2, 3)
    assert client.getBarometerData("", vehicle).pressure > 0


def ask_nonsense(client, rng, vehicle):
    call = client.client.call
    calls = (
        lambda: client.simSetVehiclePose(airsim.Pose(hostile_vector(rng)), True, vehicle),
        lambda: client.simGetImages([airsim.ImageRequest("none", rng.randint(-5, 99))], vehicle),
        lambda: client.tfCreateVoxelGrid(hostile_vector(rng), hostile_vector(rng), hostile_number(rng)),
        lambda: client.moveOnPathAsync([hostile_vector(rng)] * 3, hostile_number(rng), 1, vehicle_name=vehicle).get(),
        lambda: client.simListSceneObjects(rng.choice((".*", "(a+)+$", "[", "x" * 5000))),
        lambda: client.simSetCameraFov("3", hostile_number(rng), vehicle),
        lambda: call("moveToPosition", 1, 2, 3),
        lambda: call("no such method", *range(rng.randint(0, 5))),
        lambda: call("simGetVehiclePose", {"a": [None] * 50}),
    )
    rng.choice(calls)()


def look_around(client, rng, vehicle):
    assert client.ping() is True
    assert not client.simGetVehiclePose(vehicle).containsNan()
    assert vehicle in client.listVehicles()
    client.simGetCollisionInfo(vehicle)
    client.tfStatistics()
    client.tfGeodeticPose(vehicle)
    client.tfCreateVoxelGrid(airsim.Vector3r(rng.uniform(-20, 20), 0, -2), airsim.Vector3r(8, 8, 8), 0.5)


def send_garbage(port, rng):
    with socket.create_connection(("127.0.0.1", port), timeout=10) as one:
        try:
            one.sendall(rng.choice((rng.randbytes(rng.randint(1, 5000)), b"\x94\x00\x00\xa4ping",
                                    b"\x94\x00\x01\xdd\xff\xff\xff\xff", b"\x94\x00\x01\xacsimGetImages\x93")))
            time.sleep(rng.uniform(0, 0.2))
        except OSError:
            pass  # the server has closed it


def run_client(port, seed):
    """Until killed. Exit code 1: an answer that is not as it should be."""
    rng = random.Random(seed)
    client = airsim.MultirotorClient(port=port, timeout_value=PATIENCE_S)
    actions = (pictures, pictures, fly, sense, ask_nonsense, look_around)
    while True:
        action = rng.choice(actions)
        try:
            action(client, rng, rng.choice(VEHICLES))
        except airsim.TransportError:
            raise
        except airsim.RPCError as refusal:  # such as a take-off of what flies, or of nonsense
            if action not in (fly, ask_nonsense) or not str(refusal).startswith("rpclib: "):
                raise
        if rng.random() < 0.05:
            send_garbage(port, rng)
        if rng.random() < 0.02:
            client.close()
            client = airsim.MultirotorClient(port=port, timeout_value=PATIENCE_S)


def goal_m(time_s):
    return 12 if int(time_s / 15) % 2 else 2


def run_ardupilot(port):
    """Until killed: up and down between 2 and 12 m, all motors alike, in real time where the machine keeps up."""
    begin = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.settimeout(PATIENCE_S)
        link.connect(("127.0.0.1", port))
        height = climb = 0.0
        frame = 0
        while True:
            to_climb = max(-2, min(2, goal_m(frame / AUTOPILOT_RATE) - height))
            pulse = round(min(1900, max(1100, 1715 + 60 * (to_climb - climb))))
            link.send(struct.pack("<HHI16H", 18458, AUTOPILOT_RATE, frame, *[pulse] * 16))
            state = json.loads(link.recv(65536))
            frame += 1
            if abs(state["timestamp"] - frame / AUTOPILOT_RATE) > 1e-6:
                raise SystemExit(f"time has drifted: {state['timestamp']} s after {frame} frames")
            height, climb = -state["position"][2], -state["velocity"][2]
            if not -1 < height < 30:
                raise SystemExit(f"the vehicle is at {height} m")
            time.sleep(max(0, begin + frame / AUTOPILOT_RATE - time.monotonic()))


def x25(octets):
    """MAVLink's check sum."""
    crc = 0xFFFF
    for octet in octets:
        t = octet ^ (crc & 0xFF)
        t = (t ^ (t << 4)) & 0xFF
        crc = (crc >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4)
    return crc & 0xFFFF


def mavlink_frame(stream):
    """(number, payload) of the next MAVLink 2 frame, unsigned as the simulator's are; zeros cut from the payload's end are put back."""
    head = stream.read(10)
    if len(head) < 10:
        raise SystemExit("the simulator has closed PX4's connection")
    if head[0] != 0xFD or head[2]:
        raise SystemExit(f"no MAVLink frame: {head.hex()}")
    payload, crc = stream.read(head[1]), stream.read(2)
    assert len(payload) == head[1] and len(crc) == 2
    return int.from_bytes(head[7:10], "little"), payload.ljust(255, b"\0")


def actuator_controls(time_us, output, sequence):
    payload = struct.pack("<QQ16fB", time_us, 1, *[output] * 16, ARMED)
    checked = struct.pack("<BBBBBB", len(payload), 0, 0, sequence % 256, 1, 1) + HIL_ACTUATOR_CONTROLS.to_bytes(3, "little") + payload
    return b"\xfd" + checked + struct.pack("<H", x25(checked + bytes([HIL_ACTUATOR_CONTROLS_CRC_EXTRA])))


def run_px4(port):
    """Until killed: as run_ardupilot, in lockstep by time stamps, as fast as the server's clock goes."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as link:
        stream = link.makefile("rb")
        ground = None
        height = climb = sequence = last_us = 0
        while True:
            number, payload = mavlink_frame(stream)
            if number == HIL_STATE_QUATERNION:
                altitude, _, _, down = struct.unpack_from("<i3h", payload, 44)
                ground = altitude if ground is None else ground
                height, climb = 1e-3 * (altitude - ground), -0.01 * down
            if number != HIL_SENSOR:
                continue
            time_us, = struct.unpack_from("<Q", payload)
            if time_us <= last_us or not -1 < height < 30:
                raise SystemExit(f"time went from {last_us} to {time_us} us; the vehicle is at {height} m")
            last_us = time_us
            to_climb = max(-2, min(2, goal_m(1e-6 * time_us) - height))
            link.sendall(actuator_controls(time_us, min(0.9, max(0.2, 0.59 + 0.06 * (to_climb - climb))), sequence))
            sequence += 1


class Viewer:
    """Watches every channel that there is or comes, and reads as fast as it can."""

    def __init__(self, port):
        import programs

        self.bytes = 0
        self.failure = None
        self._frame = programs.frame
        self._link, accepted = programs.connect(port)
        if not accepted:
            raise SystemExit("soak: the viewer was not accepted")
        self._link.settimeout(60)
        threading.Thread(target=self._read, daemon=True).start()
        self._link.sendall(self._frame(json.dumps({"op": "subscribe", "subscriptions": [
            {"id": n, "channelId": n} for n in range(1, 40)]}).encode()))

    def _read(self):
        try:
            stream = self._link.makefile("rb")
            while b"\r\n" != stream.readline():  # the rest of the handshake
                pass
            while True:
                self._read_frame(stream)
        except OSError as error:
            self.failure = str(error)

    def _read_frame(self, stream):
        """A frame of a server (RFC 6455, section 5.2); pings are answered."""
        head = stream.read(2)
        if len(head) < 2 or head[0] & 15 == 8:
            raise OSError("the server has closed the viewer's connection")
        size = head[1]
        if size >= 126:
            size = int.from_bytes(stream.read(2 if size == 126 else 8), "big")
        payload = stream.read(size)
        self.bytes += len(payload)
        if head[0] & 15 == 9:
            self._link.sendall(struct.pack(">BB4x", 0x8A, 0x80 | len(payload)) + payload)


def memory_kb(pid):
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    raise RuntimeError("the server has ended")


def start_client(port, seed):
    return subprocess.Popen([sys.executable, __file__, "--client-of", str(port), "--seed", str(seed)],
                            stderr=subprocess.PIPE, text=True)


class Autopilot:
    """A process that flies a vehicle; killed and started again now and then."""

    def __init__(self, listening):
        self.kind, self.port = "px4" if "PX4" in listening["protocol"] else "ardupilot", listening["port"]
        self.start()

    def start(self):
        self.process = subprocess.Popen([sys.executable, __file__, f"--{self.kind}-of", str(self.port)], stderr=subprocess.PIPE,
                                        text=True)

    def stop(self):
        self.process.kill()
        self.process.communicate()


def start_server(binary, source, folder, everything):
    settings, more = json.loads(json.dumps(SETTINGS)), []
    if everything:
        settings["Vehicles"].update(FLOWN)
        more = ["--foxglove", "--foxglove-port", "0", "--foxglove-rate", "10", "--ros2", "--domain", "87"]
    (folder / "settings.json").write_text(json.dumps(settings))
    process = subprocess.Popen([binary, "serve", str(source), "--settings", str(folder / "settings.json"), "--port", "0",
                                "--json", "--quiet", "--threads", "2", *more], stdout=subprocess.PIPE, text=True)
    text = ""
    for line in process.stdout:
        text += line
        if line.startswith("}"):
            return process, json.loads(text)
    raise RuntimeError("the server did not start")


class Soak:
    def __init__(self, server, listening, clients, seed):
        self.server, self.port, self.rng, self.seed = server, listening["port"], random.Random(seed), seed
        self.autopilots = [Autopilot(one) for one in listening["autopilots"]]
        self.viewer = Viewer(listening["foxglove_port"]) if "foxglove_port" in listening else None
        self.clients = [self.next_client() for _ in range(clients)]
        self.killed, self.samples = 0, []

    def next_client(self):
        self.seed += 1
        return start_client(self.port, self.seed)

    def run(self, seconds):
        begin = time.monotonic()
        next_kill = begin + 1.0
        while (now := time.monotonic()) < begin + seconds:
            time.sleep(0.1)
            self.samples.append((now - begin, memory_kb(self.server.pid)))
            for client in [*self.clients, *(one.process for one in self.autopilots)]:
                self.check_alive(client)
            if self.viewer and self.viewer.failure:
                raise SystemExit("soak: " + self.viewer.failure)
            if now > next_kill:
                next_kill = now + self.rng.uniform(0.3, 2.0)
                self.kill_one()
        for client in self.clients:
            self.check_alive(client)
            client.kill()
            client.communicate()

    def check_alive(self, client):
        if self.server.poll() is not None:
            raise SystemExit(f"soak: the server has ended with {self.server.returncode}")
        if client.poll() is not None:
            raise SystemExit("soak: a client has failed: " + client.stderr.read())

    def kill_one(self):
        for autopilot in self.autopilots:
            if self.rng.random() < 0.05:
                autopilot.stop()
                autopilot.start()
        i = self.rng.randrange(len(self.clients))
        self.clients[i].kill()
        self.clients[i].communicate()
        self.clients[i] = self.next_client()
        self.killed += 1

    def memory_mb(self):
        """Medians of each eighth of the time. The first two are the warm-up."""
        end = self.samples[-1][0] + 1e-9
        return [statistics.median(kb for t, kb in self.samples if i <= 8 * t / end < i + 1) / 1024 for i in range(8)]


def check_nothing_is_stuck(port):
    """Of what the killed clients left, only tasks in the air may still run, and they can be cancelled."""
    with airsim.MultirotorClient(port=port, timeout_value=60) as client:
        for _ in range(200):
            for vehicle in VEHICLES:
                client.cancelLastTask(vehicle)
            seen = client.tfStatistics()
            if (seen.server.running, seen.server.connections, seen.simulator.tasks_running) == (1, 1, 0):
                return seen  # this very call, over this very connection
            time.sleep(0.1)
        raise SystemExit(f"soak: something is stuck: {seen}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default=os.environ.get("TILEFLIGHT_BINARY", "build/release/bin/tileflight"))
    parser.add_argument("--source", help="tileset (default: a small one made by hand)")
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--clients", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--memory-tolerance", type=float, default=0.02)
    parser.add_argument("--all", action="store_true", help="with autopilots, a viewer and ROS 2")
    parser.add_argument("--ardupilot-of", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--px4-of", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--client-of", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.client_of:
        return run_client(options.client_of, options.seed)
    if options.ardupilot_of:
        return run_ardupilot(options.ardupilot_of)
    if options.px4_of:
        return run_px4(options.px4_of)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        server, listening = start_server(options.binary, options.source or tiny_place.write(folder / "place"), folder, options.all)
        try:
            soak = Soak(server, listening, options.clients, 1000 * options.seed)
            soak.run(60 * options.minutes)
            seen = check_nothing_is_stuck(listening["port"])
            for autopilot in soak.autopilots:
                autopilot.stop()
            server.send_signal(signal.SIGTERM)
            code = server.wait(timeout=60)
        finally:
            server.kill()
    memory = soak.memory_mb()
    before, after = memory[2], memory[7]
    print(f"{60 * options.minutes:.0f} s, {options.clients} clients, {soak.killed} killed, "
          f"{seen.server.requests} requests, {seen.server.connections_cut} connections cut, "
          f"{seen.simulator.images} images; memory {before:.1f} -> {after:.1f} MB ({after / before - 1:+.2%}); "
          f"exit code {code}"
          + (f"; {seen.simulator.sim_seconds:.0f} s simulated, {soak.viewer.bytes / 1e6:.0f} MB to the viewer" if soak.viewer else "")
          + "\nby eighths of the time: " + " ".join(f"{mb:.1f}" for mb in memory))
    if code != 0:
        raise SystemExit("soak: the server did not end cleanly")
    if abs(after / before - 1) > options.memory_tolerance:
        raise SystemExit(f"soak: memory changed by more than {options.memory_tolerance:.0%}")


if __name__ == "__main__":
    main()
