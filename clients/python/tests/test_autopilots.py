"""Autopilots at the ports of a running `tileflight serve`, while a client looks on."""
import json
import socket
import struct
import unittest

import tileflight_airsim as airsim
from running_server import RunningServer

COPTER = {"Vehicles": {"Copter": {"VehicleType": "ArduCopter", "ControlPort": 0}}}
PX4 = {"Vehicles": {"PX4": {"VehicleType": "PX4Multirotor", "TcpPort": 0}}}


def servo_packet(frame, pwm, rate=400):
    return struct.pack("<HHI16H", 18458, rate, frame, *[pwm] * 16)


def mavlink_numbers(stream):
    """Numbers of the whole MAVLink frames in the bytes."""
    found = []
    while len(stream) >= 12 and stream[0] == 0xFD and len(stream) >= 12 + stream[1]:
        found.append(int.from_bytes(stream[7:10], "little"))
        stream = stream[12 + stream[1]:]
    return found


class Autopilots(unittest.TestCase):
    def test_packets_of_ardupilot_fly_what_the_client_sees(self):
        with RunningServer(COPTER) as server:
            where, = server.listening["autopilots"]
            self.assertEqual((where["vehicle"], where["protocol"], len(where["home"])), ("Copter", "ArduPilot JSON, UDP", 4))
            client = server.client()
            ground = client.getMultirotorState().kinematics_estimated.position.z_val
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
                link.settimeout(30)
                link.connect((where["address"], where["port"]))
                for frame in range(400):
                    link.send(servo_packet(frame, 2000))
                    state = json.loads(link.recv(65536))
            # A second of full thrust, straight up: 16.7 N on 1 kg.
            self.assertAlmostEqual(state["timestamp"], 1.0)
            self.assertAlmostEqual(state["position"][2], -(16.7 - 9.81) / 2, delta=0.25)
            seen = client.getMultirotorState()
            self.assertAlmostEqual(seen.kinematics_estimated.position.z_val - ground, state["position"][2], places=3)
            self.assertEqual(seen.landed_state, airsim.LandedState.Flying)
            image, = client.simGetImages([airsim.ImageRequest("0", airsim.ImageType.Scene, False, False)])
            self.assertGreater(len(image.image_data_uint8), 0)
            code, _, errors = server.stop()
            self.assertEqual(code, 0)
            self.assertIn("ArduPilot has started", errors)

    def test_px4_gets_sensors_as_soon_as_it_connects(self):
        with RunningServer(PX4) as server:
            where, = server.listening["autopilots"]
            with socket.create_connection((where["address"], where["port"]), timeout=30) as link:
                stream = b""
                while 107 not in mavlink_numbers(stream):
                    stream += link.recv(65536)
            self.assertEqual(mavlink_numbers(stream)[:3], [0, 115, 107])  # no fix yet: the receiver starts after a second
            code, _, errors = server.stop()
            self.assertEqual(code, 0)
            self.assertIn("PX4 has connected", errors)

    def test_a_port_that_is_taken_is_one_line(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            settings = {"Vehicles": {"Copter": {"VehicleType": "ArduCopter", "ControlPort": taken.getsockname()[1]}}}
            server = RunningServer(settings)
            try:
                with self.assertRaisesRegex(RuntimeError, r"UDP port \d+ of 127.0.0.1: cannot listen on it .*ControlPort\n$"):
                    server.__enter__()
                self.assertEqual(server.process.wait(timeout=30), 1)
            finally:
                server.__exit__()


if __name__ == "__main__":
    unittest.main()
