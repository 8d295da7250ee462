import unittest

import numpy as np
import place

import tileflight as tf


class OdometryTest(unittest.TestCase):
    def test_poses_and_map_are_those_of_the_command(self):
        out = place.work_folder() / "tracked"
        written = tf.odometry(place.dataset(), out=out, force=True)
        self.assertFalse(written["lost"])

        flight = tf.Flight.plan(str(place.flight_file()))
        odometry = tf.Odometry(flight.camera)
        states = [odometry.add(frame.rgb, frame.time) for frame in tf.render_flight(place.scene_of_the_flight(), flight)]
        self.assertIn("initializing", {state.status for state in states})
        self.assertEqual(states[-1].status, "tracked")
        self.assertEqual(states[-1].pose.shape, (4, 4))
        result = odometry.finish()
        rows = np.loadtxt(out / "trajectory.txt")
        np.testing.assert_allclose(result["trajectory"]["times"], rows[:, 0], atol=1e-9)
        np.testing.assert_allclose(result["trajectory"]["poses"][:, :3, 3], rows[:, 1:4], atol=1e-8)
        self.assertEqual(len(result["map"]["points"]), written["points"])
        for key in ("frames_before_start", "frames_tracked_backwards"):
            self.assertEqual(result[key], written[key])

        score = tf.evaluate_trajectory(**result["trajectory"], true_times=flight.times, true_poses=flight.poses)
        self.assertLess(score["ate_rmse"], 0.1)

    def test_settings_are_the_keys_of_an_experiment(self):
        camera = tf.Camera.pinhole(64, 48, 80)
        tf.Odometry(camera, max_keyframes=6, loop_closure=True)
        with self.assertRaisesRegex(tf.InputError, "max_keyframs"):
            tf.Odometry(camera, max_keyframs=6)

    def test_another_camera_makes_the_first_image_metric(self):
        camera = tf.Camera.pinhole(320, 240, 80)
        beside = np.eye(4)
        beside[0, 3] = -0.2
        grains = np.random.default_rng(1).uniform(30, 220, (60, 90)).repeat(4, axis=0).repeat(4, axis=1)
        smooth = sum(np.roll(grains, (y, x), (0, 1)) for y in range(4) for x in range(4)) / 16
        wall = smooth.astype(np.uint8)
        left, right = np.ascontiguousarray(wall[:240, :320]), np.ascontiguousarray(wall[:240, 8:328])

        odometry = tf.Odometry(camera, other_cameras=[(camera, beside)])
        self.assertEqual(odometry.add(left, 0.0, others=[right]).status, "tracked")
        self.assertEqual(odometry.add(left, 0.1, others=[None]).status, "tracked")
        self.assertTrue(odometry.finish()["metric"])
        self.assertEqual(tf.Odometry(camera).add(left, 0.0).status, "initializing")
        with self.assertRaisesRegex(tf.InputError, "is where the reference camera is"):
            tf.Odometry(camera, other_cameras=[(camera, np.eye(4))])

    def test_images_are_checked(self):
        odometry = tf.Odometry(tf.Camera.pinhole(64, 48, 80))
        with self.assertRaisesRegex(ValueError, r"an image must have shape \(height, width, 3\)"):
            odometry.add(np.zeros((48, 64, 4), np.uint8), 0.0)
        with self.assertRaises(tf.InputError):
            odometry.add(np.zeros((64, 48, 3), np.uint8), 0.0)
        self.assertEqual(odometry.add(np.zeros((48, 64), np.uint8), 0.0).status, "initializing")


class ScoringTest(unittest.TestCase):
    def test_umeyama_finds_the_similarity(self):
        points = np.random.default_rng(2).normal(size=(20, 3))
        truth = place.looking_down(1, 2, 3, yaw=0.7)
        truth[:3, :3] *= 2.5
        found = tf.umeyama(points, points @ truth[:3, :3].T + truth[:3, 3])
        np.testing.assert_allclose(found["T_target_source"], truth, atol=1e-12)
        self.assertAlmostEqual(found["scale"], 2.5)

    def test_icp_brings_samples_back_to_the_surface(self):
        samples = place.scene().sample_surface(per_m2=0.5)["points"]
        moved = samples + [0.2, -0.1, 0.15]
        found = tf.icp(moved, place.scene(), method="point-to-mesh", radius=2.0, with_scale=False)
        self.assertTrue(found["converged"])
        np.testing.assert_allclose(found["T_target_source"][:3, 3], [-0.2, 0.1, -0.15], atol=0.01)


if __name__ == "__main__":
    unittest.main()
