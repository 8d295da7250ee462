import gc
import unittest

import numpy as np
import place
from PIL import Image
from test_scene import plane

import tileflight as tf


class RenderTest(unittest.TestCase):
    def test_depth_over_a_plane_is_the_height(self):
        frame = tf.Renderer(plane(), tf.Camera.pinhole(64, 48, 90)).render(place.looking_down(0, 0, 12))
        self.assertEqual(frame.rgb.shape, (48, 64, 3))
        np.testing.assert_allclose(frame.depth, 12, rtol=1e-6)

    def test_rendering_without_depth_has_none(self):
        renderer = tf.Renderer(plane(), tf.Camera.pinhole(8, 8, 90), depth=False)
        self.assertIsNone(renderer.render(place.looking_down(0, 0, 12)).depth)

    def test_a_renderer_keeps_its_scene_and_a_frame_its_pixels(self):
        frame = tf.Renderer(plane(), tf.Camera.pinhole(8, 8, 90)).render(place.looking_down(0, 0, 12))
        pixels, depth = frame.rgb, frame.depth
        copy = pixels.copy()
        del frame
        gc.collect()
        np.testing.assert_array_equal(pixels, copy)
        np.testing.assert_allclose(depth, 12, rtol=1e-6)

    def test_a_flight_has_the_pixels_that_the_command_writes(self):
        flight = tf.Flight.plan(str(place.flight_file()))
        files = sorted((place.dataset() / "images").iterdir())
        self.assertEqual(len(files), len(flight))
        frames = list(tf.render_flight(place.scene_of_the_flight(), flight, end=6))
        self.assertEqual([frame.index for frame in frames], list(range(6)))
        for frame, file in zip(frames, files):
            np.testing.assert_array_equal(frame.rgb, np.asarray(Image.open(file).convert("RGB")))
            np.testing.assert_array_equal(frame.pose, flight.poses[frame.index])

    def test_a_single_image_is_the_flights(self):
        flight = tf.Flight.plan(str(place.flight_file()))
        frame = next(iter(tf.render_flight(place.scene(), flight, first=3)))
        alone = tf.Renderer(place.scene(), flight.camera).render(flight.poses[3])
        np.testing.assert_array_equal(frame.rgb, alone.rgb)

    def test_an_iterator_may_be_left_early(self):
        flight = tf.Flight.plan(str(place.flight_file()))
        with tf.render_flight(place.scene(), flight) as frames:
            next(frames)
        del frames
        gc.collect()

    def test_what_is_no_pose_is_refused(self):
        renderer = tf.Renderer(plane(), tf.Camera.pinhole(8, 8, 90))
        for matrix in (np.eye(3), 2 * np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0]), np.full((4, 4), np.nan)):
            with self.assertRaisesRegex(ValueError, "T_local_camera must"):
                renderer.render(matrix)


if __name__ == "__main__":
    unittest.main()
