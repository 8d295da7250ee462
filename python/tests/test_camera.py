import unittest

import numpy as np

import tileflight as tf


class CameraTest(unittest.TestCase):
    def test_a_pinhole_projects_by_its_equation(self):
        camera = tf.Camera("pinhole", 640, 480, 400, 410, 320, 240)
        points = np.array([[0.5, -0.2, 2.0], [0.0, 0.0, -1.0]])
        pixels = camera.project(points)
        np.testing.assert_allclose(pixels[0], [400 * 0.25 + 320, 410 * -0.1 + 240])
        self.assertTrue(np.isnan(pixels[1]).all())

    def test_every_model_projects_back_to_the_pixel(self):
        lenses = {
            "pinhole": [],
            "pinhole-radtan": [-0.1, 0.01, 1e-3, -1e-3],
            "pinhole-rational": [0.1, 0.01, 1e-3, -1e-3, 0.002, 0.1, 0.01, 0.001],
            "pinhole-equi": [0.01, -0.002, 0.001, 0.0],
            "fov": [0.9],
            "double-sphere": [-0.2, 0.55],
            "omni": [0.8, -0.02, 0.003, 0.0, 0.0],
            "eucm": [0.6, 1.1],
        }
        x, y = np.meshgrid(np.linspace(20, 620, 7), np.linspace(20, 460, 5))
        pixels = np.stack([x.ravel(), y.ravel()], axis=1)
        for model, distortion in lenses.items():
            with self.subTest(model):
                camera = tf.Camera(model, 640, 480, 350, 352, 321, 238, distortion)
                rays = camera.unproject(pixels)
                np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1)
                np.testing.assert_allclose(camera.project(3.5 * rays), pixels, atol=1e-8)
                self.assertEqual(camera.model, model)
                self.assertEqual(camera.distortion[: len(distortion)], distortion)

    def test_the_field_of_view_is_what_was_asked_for(self):
        self.assertAlmostEqual(tf.Camera.pinhole(640, 480, 80).horizontal_fov_deg, 80, places=6)
        self.assertAlmostEqual(tf.Camera.fisheye(640, 480, 155).horizontal_fov_deg, 155, places=6)

    def test_arrays_of_other_shapes_are_refused_by_name(self):
        camera = tf.Camera.pinhole(64, 48, 80)
        with self.assertRaisesRegex(ValueError, r"points must have shape \(N, 3\), not \(3,\)"):
            camera.project(np.zeros(3))
        with self.assertRaisesRegex(ValueError, "unknown lens model 'pinhoel'; known: pinhole"):
            tf.Camera("pinhoel", 64, 48, 1, 1, 1, 1)
        with self.assertRaisesRegex(ValueError, "distortion of fov has 1 numbers, not 2"):
            tf.Camera("fov", 64, 48, 1, 1, 1, 1, [1, 2])

    def test_arrays_of_any_layout_and_type_are_taken(self):
        camera = tf.Camera.pinhole(64, 48, 80)
        points = np.random.default_rng(1).uniform(1, 2, (5, 3))
        expected = camera.project(points)
        np.testing.assert_array_equal(camera.project(np.asfortranarray(points)), expected)
        np.testing.assert_array_equal(camera.project(points.repeat(2, axis=0)[::2]), expected)
        np.testing.assert_allclose(camera.project(points.astype(np.float32)), expected, rtol=1e-5)


if __name__ == "__main__":
    unittest.main()
