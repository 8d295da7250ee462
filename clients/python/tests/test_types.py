"""Tests that need no server."""
import math
import pathlib
import tempfile
import unittest

import msgpack
import tileflight_airsim as airsim


class Rotations(unittest.TestCase):
    def test_quaternions_and_angles_are_each_others_inverse(self):
        for pitch, roll, yaw in ((0, 0, 0), (0.3, -0.4, 2.0), (-1.2, 3.0, -3.0)):
            q = airsim.to_quaternion(pitch, roll, yaw)
            self.assertAlmostEqual(q.get_length(), 1.0)
            for got, wanted in zip(airsim.to_eularian_angles(q), (pitch, roll, yaw)):
                self.assertAlmostEqual(got, wanted)

    def test_yaw_turns_from_north_to_east(self):
        east = airsim.to_quaternion(0, 0, math.pi / 2).rotate(airsim.Vector3r(1, 0, 0))
        for got, wanted in zip(east, (0, 1, 0)):
            self.assertAlmostEqual(got, wanted)

    def test_pitch_lifts_the_nose(self):
        up = airsim.to_quaternion(math.pi / 2, 0, 0).rotate(airsim.Vector3r(1, 0, 0))
        for got, wanted in zip(up, (0, 0, -1)):
            self.assertAlmostEqual(got, wanted)


class Structures(unittest.TestCase):
    def test_come_back_from_a_message(self):
        state = airsim.MultirotorState()
        state.kinematics_estimated.position = airsim.Vector3r(1, 2, 3)
        packed = msgpack.packb(state, default=lambda value: value.to_msgpack(), use_bin_type=False)
        self.assertEqual(airsim.MultirotorState.from_msgpack(msgpack.unpackb(packed)), state)

    def test_missing_fields_keep_their_defaults(self):
        self.assertEqual(airsim.Pose.from_msgpack({"position": {"x_val": 1.0}}), airsim.Pose(airsim.Vector3r(1.0)))

    def test_vectors_calculate(self):
        a, b = airsim.Vector3r(1, 2, 3), airsim.Vector3r(4, 6, 3)
        self.assertEqual((b - a).get_length(), 5)
        self.assertEqual(a.cross(b), airsim.Vector3r(2 * 3 - 3 * 6, 3 * 4 - 1 * 3, 1 * 6 - 2 * 4))
        self.assertEqual(2 * a, a + a)


class Files(unittest.TestCase):
    def test_pfm_comes_back(self):
        with tempfile.TemporaryDirectory() as folder:
            name = str(pathlib.Path(folder) / "depth.pfm")
            airsim.write_pfm(name, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
            rows, scale = airsim.read_pfm(name)
        self.assertEqual([list(row) for row in rows], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
        self.assertEqual(scale, 1.0)


if __name__ == "__main__":
    unittest.main()
