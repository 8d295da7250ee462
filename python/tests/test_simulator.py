import subprocess
import sys
import unittest

import numpy as np
import place

import tileflight as tf
from tileflight.navigation import NavigationEnv, VectorNavigationEnv
from tileflight.spaces import Box

SETTINGS = {"SimMode": "Multirotor", "StepOnDemand": True}


def flat():
    low, high = -60.0, 60.0
    ground = [[low, low, 0], [high, low, 0], [high, high, 0], [low, high, 0]]
    wall = [[20, low, 0], [20, high, 0], [20, high, 30], [20, low, 30]]
    return tf.Scene.from_mesh(ground + wall, [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])


@unittest.skipUnless(hasattr(tf, "Simulator"), "the library was built without the simulator")
class SimulatorTest(unittest.TestCase):
    def setUp(self):
        self.simulator = tf.Simulator.of_scene(flat(), SETTINGS, ned_origin=[0, 0, 0])
        self.simulator.enable_control()
        self.simulator.arm()

    def tearDown(self):
        self.simulator.close()

    def test_it_takes_off_and_goes_where_it_is_told(self):
        self.assertTrue(self.simulator.takeoff())
        self.assertFalse(self.simulator.state()["landed"])
        self.assertTrue(self.simulator.move_to_position([5, -3, -8], 4))
        np.testing.assert_allclose(self.simulator.state()["position"], [5, -3, -8], atol=1.0)

    def test_images_are_arrays_of_what_is_there(self):
        self.simulator.set_pose([0, 0, -2], [np.cos(np.pi / 4), 0, 0, np.sin(np.pi / 4)])  # looks east, at the wall
        rgb, depth, reach = self.simulator.images(["rgb", "depth", "range"])
        self.assertEqual((rgb.shape, rgb.dtype), ((144, 256, 3), np.dtype("uint8")))
        x = 20 - self.simulator.pose()["position"][1]
        self.assertAlmostEqual(float(depth[60, 128]), x, delta=0.6)  # the camera sits in front of the middle
        self.assertGreater(float(reach[60, 10]), float(depth[60, 10]))
        with self.assertRaisesRegex(ValueError, "unknown kind of image 'dept'; known: rgb, depth"):
            self.simulator.images(["dept"])

    def test_the_same_commands_give_the_same_flight(self):
        paths = []
        for _ in range(2):
            self.simulator.reset()
            self.simulator.enable_control()
            self.simulator.arm()
            self.simulator.takeoff()
            path = []
            for i in range(20):
                self.simulator.move_by_velocity([1, 0.1 * i, -0.5], 0.1)
                path.append(self.simulator.state()["position"])
            paths.append(np.array(path) - path[0])
        np.testing.assert_array_equal(paths[0], paths[1])

    def test_settings_are_checked(self):
        with self.assertRaisesRegex(tf.InputError, "SimMode"):
            tf.Simulator.of_scene(flat(), {"SimMode": "Submarine"})


@unittest.skipUnless(hasattr(tf, "Simulator"), "the library was built without the simulator")
class NavigationTest(unittest.TestCase):
    def test_observations_and_actions_are_in_their_spaces(self):
        for settings in ({}, {"observation": "rgb"}, {"observation": "lidar"}, {"action": "attitude"}):
            with self.subTest(settings):
                env = NavigationEnv(place.scene(), size=(32, 18), distance=(5, 10), **settings)
                observation, info = env.reset(seed=3)
                self.assertTrue(env.observation_space.contains(observation))
                self.assertEqual(set(info), {"start", "goal"})
                env.action_space.seed(1)
                for _ in range(5):
                    action = env.action_space.sample()
                    self.assertIn(action, env.action_space)
                    observation, reward, terminated, truncated, info = env.step(action)
                    self.assertTrue(env.observation_space.contains(observation))
                    self.assertEqual((type(reward), type(terminated), type(truncated)), (float, bool, bool))
                env.close()

    def test_the_lidar_sees_the_ground_below_and_the_wall_ahead(self):
        env = NavigationEnv(flat(), size=(36, 10), observation="lidar")
        observation, _ = env.reset(seed=1, options={"start": [5, 0, 6], "goal": [40, 0, 6]})
        ranges = observation["image"][:, :, 0]
        self.assertEqual(ranges.shape, (10, 36))
        elevations = np.radians(np.linspace(15, -30, 10))
        azimuths = np.radians(np.arange(36) * 10.0 - 180)
        position, orientation = env.simulator.state()["position"], env.simulator.state()["orientation"]
        w, x, y, z = orientation
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        origin = env._origin + [position[1], position[0], -position[2]]
        for row, elevation in enumerate(elevations):
            level = np.cos(elevation)
            heading = azimuths + yaw  # clockwise from north
            rays = np.stack([level * np.sin(heading), level * np.cos(heading), np.full(36, np.sin(elevation))], axis=1)
            expected = np.minimum(env.scene.cast_rays(np.tile(origin, (36, 1)), rays)["distance"], 100)
            near = np.abs(ranges[row] - expected) < 0.05 * expected
            self.assertGreater(near.mean(), 0.9, f"row {row}")  # beams at the wall's edges may miss it

    def test_gymnasium_makes_it_where_that_is_installed(self):
        script = """
import sys, types
made = {}
gymnasium = types.ModuleType("gymnasium")
gymnasium.Env = type("Env", (), {})
gymnasium.register = lambda id, entry_point, **rest: made.update({id: entry_point})
sys.modules["gymnasium"] = gymnasium
import tileflight.navigation as navigation
module, name = made["tileflight/Navigation-v0"].split(":")
assert getattr(sys.modules[module], name) is navigation.NavigationEnv
assert issubclass(navigation.NavigationEnv, gymnasium.Env)
"""
        subprocess.run([sys.executable, "-c", script], check=True)

    def test_a_seed_repeats_an_episode(self):
        def episode(env):
            images = [env.reset(seed=11)[0]["image"]]
            for i in range(6):
                images.append(env.step([0.5, np.sin(i), -0.1, 0.2])[0]["image"])
            return np.stack(images)

        env = NavigationEnv(place.scene(), size=(32, 18), distance=(5, 10))
        first = episode(env)
        np.testing.assert_array_equal(episode(env), first)
        np.testing.assert_array_equal(episode(NavigationEnv(place.scene(), size=(32, 18), distance=(5, 10))), first)

    def test_flying_at_the_goal_arrives(self):
        env = NavigationEnv(flat(), size=(16, 9), max_speed=4.0)
        observation, _ = env.reset(seed=1, options={"start": [-20, 0, 6], "goal": [-5, 3, 7]})
        self.assertAlmostEqual(float(np.linalg.norm(observation["goal"])), np.sqrt(15**2 + 3**2 + 1), delta=0.5)
        total = 0.0
        for _ in range(150):
            goal = observation["goal"]
            action = np.append(goal / np.linalg.norm(goal), 0.0)
            observation, reward, terminated, truncated, info = env.step(action)
            total += reward
            if terminated or truncated:
                break
        self.assertTrue(info["is_success"])
        self.assertGreater(total, 15)

    def test_flying_into_the_wall_ends(self):
        env = NavigationEnv(flat(), size=(16, 9))
        observation, _ = env.reset(seed=1, options={"start": [5, 0, 6], "goal": [40, 0, 6]})
        for _ in range(100):
            goal = observation["goal"]
            observation, reward, terminated, _, info = env.step(np.append(goal / np.linalg.norm(goal), 0.0))
            if terminated:
                break
        self.assertTrue(info["has_collided"])
        self.assertLess(reward, -5)

    def test_vectors_are_the_single_ones_stacked(self):
        settings = {"size": (16, 9), "distance": (5, 10)}
        envs = VectorNavigationEnv(place.scene(), 2, **settings)
        observation, _ = envs.reset(seed=4)
        observation, rewards, *_ = envs.step([[0.3, 0, 0, 0], [0, 0.3, 0, 0]])
        self.assertEqual(observation["image"].shape, (2, 9, 16, 1))
        alone = NavigationEnv(place.scene(), **settings)
        alone.reset(seed=5)
        expected, reward, *_ = alone.step([0, 0.3, 0, 0])
        np.testing.assert_array_equal(observation["image"][1], expected["image"])
        self.assertEqual(rewards[1], reward)
        envs.close()

    def test_boxes_hold_what_they_say(self):
        box = Box(-1, 1, (3,), np.float32)
        self.assertIn(np.zeros(3, np.float32), box)
        self.assertNotIn(np.full(3, 2.0, np.float32), box)
        self.assertNotIn(np.zeros(2, np.float32), box)
        box.seed(1)
        first = box.sample()
        box.seed(1)
        np.testing.assert_array_equal(box.sample(), first)


if __name__ == "__main__":
    unittest.main()
