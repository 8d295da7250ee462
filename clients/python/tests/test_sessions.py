"""Sessions that `serve --record` writes and `serve --replay` repeats. TILEFLIGHT_BINARY names the program."""
import io
import json
import os
import pathlib
import signal
import subprocess
import tempfile
import threading
import unittest

import msgpack
import tileflight_airsim as airsim
import tiny_place
from running_server import RunningServer

# By the wall clock: what makes a repetition hard.
TWO = {"StepOnDemand": False, "ClockSpeed": 10, "Vehicles": {
    "A": {"VehicleType": "SimpleFlight"}, "B": {"VehicleType": "SimpleFlight", "Y": 3}}}


def fly(server, vehicle, east, poses):
    client = server.client()
    client.enableApiControl(True, vehicle)
    client.takeoffAsync(vehicle_name=vehicle).join()
    flight = client.moveToPositionAsync(5, east, -8, 4, vehicle_name=vehicle)
    for _ in range(15):
        client.simGetImages([airsim.ImageRequest("bottom_center", airsim.ImageType.Scene, False, False)], vehicle)
        poses.append(client.simGetVehiclePose(vehicle).position.z_val)
    flight.join()


class Sessions(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.file = pathlib.Path(self.folder.name) / "session"

    def replay(self, *options, place=None):
        tileset = tiny_place.write(place or pathlib.Path(self.folder.name) / "place")
        return subprocess.run([os.environ["TILEFLIGHT_BINARY"], "serve", str(tileset), "--replay", str(self.file), "--files",
                               self.folder.name, "--json", "--threads", "2", *options],
                              capture_output=True, text=True, timeout=120)

    def record(self, with_signal):
        poses = {"A": [], "B": []}
        with RunningServer(TWO, "--record", str(self.file)) as server:
            pilots = [threading.Thread(target=fly, args=(server, name, east, poses[name])) for name, east in (("A", -2), ("B", 6))]
            for pilot in pilots:
                pilot.start()
            for pilot in pilots:
                pilot.join()
            server.stop(with_signal)
        return poses

    def test_two_clients_fly_two_vehicles_and_the_replay_is_equal(self):
        poses = self.record(signal.SIGTERM)
        self.assertLess(min(poses["A"] + poses["B"]), -1.0)
        done = self.replay()
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        self.assertEqual(result["answers_compared"], result["calls"])
        self.assertGreaterEqual(result["calls"], 2 * 33)
        self.assertTrue(result["complete"])

    def test_a_killed_server_leaves_a_session_up_to_there(self):
        self.record(signal.SIGKILL)
        whole = self.file.read_bytes()
        self.file.write_bytes(whole[:-3])
        done = self.replay()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertFalse(json.loads(done.stdout)["complete"])

    def test_the_first_difference_is_named(self):
        self.record(signal.SIGTERM)
        kinds = list(msgpack.Unpacker(io.BytesIO(self.file.read_bytes()), strict_map_key=False, raw=True))
        damaged = next(i for i, (kind, number, _) in enumerate(kinds) if kind == 2 and number == 12)
        kinds[damaged][2][0] = bytes(16)
        self.file.write_bytes(b"".join(msgpack.packb(one) for one in kinds))
        done = self.replay()
        self.assertEqual(done.returncode, 1)
        self.assertIn("1 answer of", done.stderr)
        self.assertIn("the first: call 12, ", done.stderr)

    def test_other_options_settings_and_files_are_refused_in_one_line(self):
        self.record(signal.SIGTERM)
        refused = self.replay("--error", "3")
        self.assertEqual(refused.returncode, 1)
        self.assertIn("was recorded with other options", refused.stderr)
        self.assertEqual(refused.stderr.count("\n"), 1)
        place = pathlib.Path(self.folder.name) / "place"
        again = subprocess.run([os.environ["TILEFLIGHT_BINARY"], "serve", str(place), "--record", str(self.file)],
                               capture_output=True, text=True, timeout=60)
        self.assertEqual(again.returncode, 1)
        self.assertIn("exists already", again.stderr)


if __name__ == "__main__":
    unittest.main()
