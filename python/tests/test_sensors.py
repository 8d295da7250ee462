import unittest

import numpy as np
import place
from test_scene import plane

import tileflight as tf


class SensorsTest(unittest.TestCase):
    def test_a_perfect_lidar_sees_the_plane(self):
        lidar = tf.Lidar(plane(), "vlp-16", perfect=True)
        level = np.eye(4)  # camera looks north, level
        level[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
        level[:3, 3] = 0, 0, 2
        scan = lidar.scan_at_rest(level)
        self.assertGreater(len(scan["points"]), 1000)
        points = scan["points"] @ scan["T_local_lidar"][:3, :3].T + scan["T_local_lidar"][:3, 3]
        np.testing.assert_allclose(points[:, 2], 0, atol=1e-3)
        for name in ("intensity", "time", "ring"):
            self.assertEqual(len(scan[name]), len(points))

    def test_a_perfect_inertial_unit_at_rest_feels_gravity(self):
        poses = np.stack([place.looking_down(0, 0, 10)] * 3)
        imu = tf.simulate_imu(tf.Path([0, 1, 2], poses), "perfect", rate_hz=100)
        self.assertEqual(len(imu["times"]), 201)
        np.testing.assert_allclose(imu["angular_rate"], 0, atol=1e-12)
        np.testing.assert_allclose(imu["specific_force"], [[0, 0, -9.80665]] * 201, atol=1e-9)

    def test_an_accelerated_unit_feels_the_second_derivative(self):
        times = np.linspace(0, 4, 41)
        poses = np.stack([place.looking_down(0.5 * t**2, 0, 10) for t in times])
        imu = tf.simulate_imu(tf.Path(times, poses), "perfect", rate_hz=50)
        middle = (imu["times"] > 1) & (imu["times"] < 3)
        np.testing.assert_allclose(imu["specific_force"][middle, 0], 1.0, atol=1e-3)

    def test_times_must_increase(self):
        with self.assertRaisesRegex(ValueError, "times must be finite and increase"):
            tf.Path([0, 0], np.stack([np.eye(4)] * 2))


if __name__ == "__main__":
    unittest.main()
