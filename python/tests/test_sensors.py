import json
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

    def test_sensors_record_what_a_rendered_flight_has(self):
        folder = place.work_folder()
        times = np.arange(0, 2.01, 0.25)
        poses = np.stack([place.looking_down(3 * t, -2 * t, 20 + t) for t in times])
        lines = [f"{t} {p[0, 3]} {p[1, 3]} {p[2, 3]} 1 0 0 0" for t, p in zip(times, poses)]
        (folder / "line.txt").write_text("\n".join(lines) + "\n")
        tf.Camera.pinhole(32, 24, 80).write(folder / "small.yaml")
        sensors = {
            "barometer": {"rate_hz": 20, "origin_above_sea_m": 100},
            "magnetometer": {"declination_deg": 4, "inclination_deg": 60, "strength_ut": 48},
            "range_finder": {"noise_m": 0.1, "rate_hz": 10},
        }
        (folder / "line.yaml").write_text(json.dumps({"camera": "small.yaml", "trajectory": "line.txt", "sensors": sensors}))
        tf.render(place.tileset(), **place.REGION, flight=folder / "line.yaml", out=folder / "line", seed=7)
        path = tf.Path(times, poses)
        scene = tf.load(str(place.tileset()), **place.REGION, anchor=poses[len(poses) // 2, :3, 3])
        recorded = tf.simulate_sensors(path, sensors, scene=scene, seed=7)
        for sensor, file, columns in (
            ("barometer", "barometer.csv", ("times", "pressure", "temperature", "altitude")),
            ("magnetometer", "magnetometer.csv", ("times", "field")),
            ("range_finder", "range.csv", ("times", "range")),
        ):
            table = np.loadtxt(folder / "line" / file, delimiter=",", skiprows=1)
            here = np.column_stack([recorded[sensor][name] for name in columns])
            self.assertGreater(len(here), 15)
            np.testing.assert_allclose(here, table, rtol=1e-9, atol=1e-6, err_msg=sensor)

    def test_perfect_sensors_read_the_path(self):
        times = np.linspace(0, 4, 9)
        path = tf.Path(times, np.stack([place.looking_down(2 * t, 0, 10) for t in times]))
        none = {"horizontal_sigma_m": 0, "vertical_sigma_m": 0, "horizontal_bias_sigma_m": 0, "vertical_bias_sigma_m": 0}
        steady = {"noise_deg": 0, "tilt_bias_sigma_deg": 0, "yaw_bias_sigma_deg": 0}
        got = tf.simulate_sensors(path, {"gnss": {"rate_hz": 2, "lag_s": 1, **none}, "attitude": {"rate_hz": 2, **steady}})
        self.assertEqual(set(got), {"gnss", "attitude"})
        np.testing.assert_allclose(got["gnss"]["position"][:, 0], 2 * np.maximum(got["gnss"]["times"] - 1, 0), atol=1e-6)
        np.testing.assert_allclose(got["attitude"]["R_local_camera"], [place.looking_down(0, 0, 0)[:3, :3]] * 9, atol=1e-9)

    def test_the_field_of_the_earth_needs_a_place_on_it(self):
        path = tf.Path([0, 1], np.stack([np.eye(4)] * 2))
        with self.assertRaisesRegex(tf.InputError, "not georeferenced"):
            tf.simulate_sensors(path, {"magnetometer": {}})
        field = tf.simulate_sensors(path, {"magnetometer": {"noise_ut": 0}}, origin=(35.3, -80.7, 200))["magnetometer"]["field"]
        self.assertTrue(45 < np.linalg.norm(field[0]) < 55)  # North Carolina

    def test_sensors_are_checked_as_in_a_flight_file(self):
        path = tf.Path([0, 1], np.stack([np.eye(4)] * 2))
        with self.assertRaisesRegex(tf.InputError, "'gnss.rate' is not a key here; did you mean 'rate_hz'"):
            tf.simulate_sensors(path, {"gnss": {"rate": 5}})
        with self.assertRaisesRegex(ValueError, "sensors has numbers that are not finite"):
            tf.simulate_sensors(path, {"gnss": {"rate_hz": np.nan}})
        with self.assertRaisesRegex(TypeError, "sensors has a value that is no number"):
            tf.simulate_sensors(path, {"gnss": {"rate_hz": {1, 2}}})
        with self.assertRaisesRegex(ValueError, "a range_finder needs a scene"):
            tf.simulate_sensors(path, {"range_finder": {}})
        with self.assertRaisesRegex(ValueError, "imu is simulated by simulate_imu"):
            tf.simulate_sensors(path, {"imu": {}})

    def test_numbers_and_vectors_may_be_numpys(self):
        path = tf.Path([0, 1], np.stack([np.eye(4)] * 2))
        plain = {"rate_hz": 4, "noise_ut": 0, "hard_iron_ut": [1, 2, 3], "declination_deg": 0, "inclination_deg": 0, "strength_ut": 50}
        numpys = {**plain, "rate_hz": np.int64(4), "hard_iron_ut": np.array([1.0, 2.0, 3.0])}
        fields = [tf.simulate_sensors(path, {"magnetometer": options})["magnetometer"]["field"] for options in (plain, numpys)]
        np.testing.assert_array_equal(fields[0], fields[1])
        np.testing.assert_allclose(fields[0], [[1, 52, 3]] * 5, atol=1e-9)

    def test_times_must_increase(self):
        with self.assertRaisesRegex(ValueError, "times must be finite and increase"):
            tf.Path([0, 0], np.stack([np.eye(4)] * 2))


if __name__ == "__main__":
    unittest.main()
