import unittest

import numpy as np
import place

import tileflight as tf


class LocalizerTest(unittest.TestCase):
    def test_images_are_located_one_by_one(self):
        flight = tf.Flight.plan(str(place.flight_file()))
        scene = place.scene_of_the_flight()
        localizer = tf.Localizer(scene, flight.camera)
        start = flight.poses[0].copy()
        start[:3, 3] += (0.4, -0.3, 0.2)
        localizer.start(start, flight.times[0])
        for frame in tf.render_flight(scene, flight):
            found = localizer.add(frame.rgb, frame.time)
            self.assertTrue(found.located)
            self.assertLess(np.linalg.norm(found.pose[:3, 3] - frame.pose[:3, 3]), 0.05)
            self.assertLess(found.sigma_position, 0.1)
            self.assertEqual(found.covariance.shape, (6, 6))
        self.assertFalse(found.lost)

    def test_an_inertial_unit_carries_it_through_images_that_show_nothing(self):
        flight = tf.Flight.plan(str(place.flight_file()))
        localizer = tf.Localizer(place.scene_of_the_flight(), flight.camera, T_imu_camera=np.eye(4))
        localizer.start(flight.poses[0], flight.times[0])
        begin, end = flight.times[0], flight.times[0] + 0.3
        for time in np.arange(begin, end + 0.05, 0.005):  # a unit that hangs still
            localizer.add_reading(time, [0, 0, 0], flight.poses[0][:3, :3].T @ [0, 0, 9.80665])
        blind = np.zeros((flight.camera.height, flight.camera.width, 3), np.uint8)
        localizer.add(blind, begin)
        found = localizer.add(blind, end)
        self.assertFalse(found.located)
        self.assertLess(np.linalg.norm(found.velocity), 0.01)
        self.assertLess(np.linalg.norm(found.pose[:3, 3] - flight.poses[0][:3, 3]), 0.01)
        self.assertGreater(found.sigma_velocity, 0.0)

    def test_it_must_be_started(self):
        localizer = tf.Localizer(place.scene(), tf.Camera.pinhole(320, 240, 80))
        with self.assertRaisesRegex(tf.InputError, "has no start"):
            localizer.add(np.zeros((240, 320, 3), np.uint8), 0.0)

    def test_the_command_is_a_function(self):
        out = place.work_folder() / "localized"
        about = tf.localize(place.dataset(), to=place.tileset(), **place.REGION, out=out, force=True)
        self.assertEqual(about["located"], about["images"])
