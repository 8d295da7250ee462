"""Reinforcement learning: a drone flies to a goal through a real place, with Gymnasium's interface.

    from tileflight.navigation import NavigationEnv
    env = NavigationEnv("tiles/tileset.json")
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

Gymnasium need not be installed; where it is, `gymnasium.make("tileflight/Navigation-v0", source=...)` works, too. The same
seed and actions give the same observations.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from . import _core
from .spaces import Box, Dict

try:
    import gymnasium as _gymnasium  # type: ignore[import-not-found]

    _Base = _gymnasium.Env
except ImportError:
    _gymnasium = None
    _Base = object

MAX_RANGE_M = 100.0
#: Lowest and highest channel of the lidar.
LIDAR_ELEVATION_DEG = (-30.0, 15.0)


def _lidar(size: tuple[int, int]) -> dict[str, Any]:
    """AirSim's settings of a lidar with `size` beams around and above each other, the first column behind the drone."""
    lowest, highest = LIDAR_ELEVATION_DEG
    turns = 10
    beams = {"NumberOfChannels": size[1], "RotationsPerSecond": turns, "PointsPerSecond": size[0] * size[1] * turns}
    view = {"HorizontalFOVStart": -180, "HorizontalFOVEnd": 180, "VerticalFOVUpper": highest, "VerticalFOVLower": lowest}
    return {"SensorType": 6, "Enabled": True, "Range": MAX_RANGE_M, "DataFrame": "SensorLocalFrame", **beams, **view}


def _range_image(points: np.ndarray, ring: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(channels, columns, 1): the range of each beam, the highest channel first; MAX_RANGE_M where nothing came back.
    points: forward, right, down."""
    image = np.full((size[1], size[0], 1), MAX_RANGE_M, np.float32)
    turn = np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) + 0.5
    columns = np.rint(turn * size[0]).astype(int) % size[0]
    image[size[1] - 1 - ring.astype(int), columns, 0] = np.minimum(np.linalg.norm(points, axis=1), MAX_RANGE_M)
    return image


def _settings(size: tuple[int, int], fov_deg: float, has_lidar: bool) -> dict[str, Any]:
    capture = {"Width": size[0], "Height": size[1], "FOV_Degrees": fov_deg}
    captures = [{"ImageType": kind, **capture} for kind in (0, 1, 2)]
    camera = {"CaptureSettings": captures, "X": 0.25, "Y": 0, "Z": 0, "Pitch": 0, "Roll": 0, "Yaw": 0}
    drone: dict[str, Any] = {"VehicleType": "SimpleFlight", "Cameras": {"front_center": camera}}
    if has_lidar:
        drone["Sensors"] = {"lidar": _lidar(size)}
    return {"SimMode": "Multirotor", "StepOnDemand": True, "Vehicles": {"drone": drone}}


def _yaw_of(orientation: np.ndarray) -> float:
    w, x, y, z = orientation
    return float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


class NavigationEnv(_Base):  # type: ignore[misc, valid-type]
    """Fly to a goal without touching anything.

    Observation, a dictionary: `image` (height, width, 1) float32 depth along the optical axis, metres, at most 100; or
    (height, width, 3) uint8 with observation="rgb"; with observation="lidar" the ranges of `size` beams, (channels, columns,
    1) float32, all around from behind over left, front and right, from 15 degrees above to 30 below; `goal` (3) float32: forward, right, down metres to the goal in the
    drone's heading; `velocity` (3) float32: forward, right, down, m/s.

    Action: `velocity`: forward, right, down, turn, each -1 to 1 of `max_speed` and 90 degrees a second; `attitude`: roll,
    pitch (each -1 to 1 of 25 degrees), turn (90 degrees a second), throttle (0.5 + half of it).

    Reward: metres that the drone came nearer to the goal, less 0.05 a step; 10 at the goal (within 2 m), -10 at a contact;
    both terminate. After `max_steps` the episode is truncated.

    source: as in `load`, or a Scene. step_s: simulated seconds of a step. height: of start and goal above the ground,
    metres (least, most). distance: from start to goal. region: of starts, minimum and maximum (2, 2) of x east, y north
    in the local frame; default: the middle half of the place.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        source: Any,
        *,
        observation: str = "depth",
        action: str = "velocity",
        size: tuple[int, int] = (128, 72),
        fov_deg: float = 90.0,
        step_s: float = 0.1,
        max_steps: int = 300,
        max_speed: float = 8.0,
        height: tuple[float, float] = (4.0, 15.0),
        distance: tuple[float, float] = (15.0, 40.0),
        region: Any = None,
        render_mode: str | None = None,
    ):
        if observation not in ("depth", "rgb", "lidar"):
            raise ValueError(f"observation must be 'depth', 'rgb' or 'lidar', not {observation!r}")
        if action not in ("velocity", "attitude"):
            raise ValueError(f"action must be 'velocity' or 'attitude', not {action!r}")
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be 'rgb_array' or None, not {render_mode!r}")
        self.scene = source if isinstance(source, _core.Scene) else _core.load(str(source))
        self._origin = self._middle_of_the_ground()
        self.simulator = _core.Simulator.of_scene(
            self.scene, _settings(size, fov_deg, observation == "lidar"), ned_origin=self._origin
        )
        self.render_mode = render_mode
        self.max_steps = max_steps
        self._observation, self._action, self._size = observation, action, size
        self._step_s, self._max_speed = step_s, max_speed
        self._height, self._distance = height, distance
        self._region = self._default_region() if region is None else np.asarray(region, float).reshape(2, 2)
        channels, bound, kind = (3, 255, np.uint8) if observation == "rgb" else (1, MAX_RANGE_M, np.float32)
        self.observation_space = Dict(
            {
                "image": Box(0, bound, (size[1], size[0], channels), kind),
                "goal": Box(-np.inf, np.inf, (3,), np.float32),
                "velocity": Box(-np.inf, np.inf, (3,), np.float32),
            }
        )
        self.action_space = Box(-1.0, 1.0, (4,), np.float32)
        self.np_random = np.random.default_rng()
        self._steps: int | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict, dict]:
        """A new start and goal. options: `start`, `goal`: local points (3), metres, instead of random ones."""
        if seed is not None:
            self.np_random = np.random.default_rng(seed)
        options = options or {}
        start = np.asarray(options["start"], float) if "start" in options else self._free_point(self._random_place())
        goal = np.asarray(options["goal"], float) if "goal" in options else self._random_goal(start)
        self._goal = self._to_ned(goal)
        yaw = self.np_random.uniform(-np.pi, np.pi)
        self.simulator.reset()
        self.simulator.enable_control()
        self.simulator.arm()
        self.simulator.set_pose(self._to_ned(start), [np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
        self._yaw = yaw
        self._steps = 0
        self._state = self.simulator.state()
        self._contact_time = self.simulator.collision()["time"]
        self._left = self._distance_left()
        return self._observe(), {"start": start, "goal": goal}

    def step(self, action: Any) -> tuple[dict, float, bool, bool, dict]:
        if self._steps is None:
            raise RuntimeError("step() before reset()")
        action = np.clip(np.asarray(action, float).reshape(4), -1, 1)
        self._fly(action)
        self._steps += 1
        self._state = self.simulator.state()
        before, self._left = self._left, self._distance_left()
        contact = self.simulator.collision()
        has_collided = contact["has_collided"] and contact["time"] > self._contact_time
        is_there = self._left < 2.0
        reward = before - self._left - 0.05 + 10.0 * is_there - 10.0 * has_collided
        info = {"distance": self._left, "is_success": is_there, "has_collided": has_collided}
        truncated = self._steps >= self.max_steps and not (is_there or has_collided)
        return self._observe(), float(reward), bool(is_there or has_collided), bool(truncated), info

    def render(self) -> np.ndarray | None:
        """The drone's view (height, width, 3), in render_mode 'rgb_array'."""
        return self.simulator.images(["rgb"])[0] if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        self.simulator.close()

    @property
    def unwrapped(self) -> NavigationEnv:
        return self

    def _fly(self, action: np.ndarray) -> None:
        if self._action == "velocity":
            self.simulator.move_by_velocity_body(action[:3] * self._max_speed, self._step_s, 90.0 * action[3])
            return
        self._yaw += np.radians(90.0) * action[2] * self._step_s
        roll, pitch = np.radians(25.0) * action[:2]
        self.simulator.move_by_attitude(roll, pitch, self._yaw, 0.5 + 0.5 * action[3], self._step_s)

    def _image(self) -> np.ndarray:
        if self._observation == "lidar":
            scan = self.simulator.lidar("lidar")
            return _range_image(scan["points"], scan["ring"], self._size)
        image = self.simulator.images([self._observation])[0]
        return image if self._observation == "rgb" else np.minimum(image, np.float32(MAX_RANGE_M))[:, :, None]

    def _observe(self) -> dict[str, np.ndarray]:
        to_goal = self._goal - self._state["position"]
        return {"image": self._image(), "goal": self._in_heading(to_goal), "velocity": self._in_heading(self._state["linear_velocity"])}

    def _in_heading(self, ned: np.ndarray) -> np.ndarray:
        yaw = _yaw_of(self._state["orientation"])
        c, s = np.cos(yaw), np.sin(yaw)
        return np.array([c * ned[0] + s * ned[1], c * ned[1] - s * ned[0], ned[2]], np.float32)

    def _distance_left(self) -> float:
        return float(np.linalg.norm(self._goal - self._state["position"]))

    def _default_region(self) -> np.ndarray:
        low, high = self.scene.bounds[:, :2]
        middle, size = (low + high) / 2, high - low
        return np.stack([middle - size / 4, middle + size / 4])

    def _middle_of_the_ground(self) -> np.ndarray:
        low, high = self.scene.bounds
        ground = self._ground((low[:2] + high[:2]) / 2)
        return np.where(np.isfinite(ground), ground, low)

    def _ground(self, xy: np.ndarray) -> np.ndarray:
        """The highest surface at x, y; NaN height where there is none."""
        top = self.scene.bounds[1, 2] + 1.0
        distance = self.scene.cast_rays([[xy[0], xy[1], top]], [[0, 0, -1]])["distance"][0]
        return np.array([xy[0], xy[1], top - distance if np.isfinite(distance) else np.nan])

    def _to_ned(self, local: np.ndarray) -> np.ndarray:
        d = np.asarray(local, float) - self._origin
        return np.array([d[1], d[0], -d[2]])

    def _random_place(self) -> np.ndarray:
        return self.np_random.uniform(self._region[0], self._region[1])

    def _free_point(self, xy: np.ndarray) -> np.ndarray:
        """A point above the ground near x, y with room around it."""
        for _ in range(1000):
            point = self._ground(xy)
            point[2] += self.np_random.uniform(*self._height)
            if np.isfinite(point[2]) and self.scene.distance_to_surface([point], within=2.0)[0] == np.inf:
                return point
            xy = self._random_place()
        raise ValueError("no free place with ground below was found; give `region` and `height`")

    def _random_goal(self, start: np.ndarray) -> np.ndarray:
        for _ in range(1000):
            angle, distance = self.np_random.uniform(0, 2 * np.pi), self.np_random.uniform(*self._distance)
            goal = self._ground(start[:2] + distance * np.array([np.cos(angle), np.sin(angle)]))
            goal[2] += self.np_random.uniform(*self._height)
            if np.isfinite(goal[2]) and self.scene.distance_to_surface([goal], within=2.5)[0] == np.inf:
                return goal
        raise ValueError("no goal at that distance has ground below; give `region` and `distance`")


class VectorNavigationEnv:
    """`count` environments stepped at once, with Gymnasium's interface of vectors: arrays get a first axis, and an
    environment whose episode has ended is reset at the next step (its action is ignored then)."""

    def __init__(self, source: Any, count: int, **settings: Any):
        scene = source if isinstance(source, _core.Scene) else _core.load(str(source))
        self.envs = [NavigationEnv(scene, **settings) for _ in range(count)]
        self.num_envs = count
        self.single_observation_space = self.envs[0].observation_space
        self.single_action_space = self.envs[0].action_space
        self._pool = ThreadPoolExecutor(count)
        self._ended = np.zeros(count, bool)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict, dict]:
        seeds = [None if seed is None else seed + i for i in range(self.num_envs)]
        results = list(self._pool.map(lambda e, s: e.reset(seed=s, options=options), self.envs, seeds))
        self._ended[:] = False
        return self._stack([r[0] for r in results]), {"infos": [r[1] for r in results]}

    def step(self, actions: Any) -> tuple[dict, np.ndarray, np.ndarray, np.ndarray, dict]:
        def advance(env: NavigationEnv, action: Any, ended: bool) -> tuple:
            if ended:
                observation, info = env.reset()
                return observation, 0.0, False, False, info
            return env.step(action)

        results = list(self._pool.map(advance, self.envs, np.asarray(actions), self._ended))
        observations, rewards, terminated, truncated, infos = zip(*results)
        self._ended = np.array(terminated) | np.array(truncated)
        return (
            self._stack(observations),
            np.array(rewards),
            np.array(terminated),
            np.array(truncated),
            {"infos": list(infos)},
        )

    def close(self) -> None:
        for env in self.envs:
            env.close()
        self._pool.shutdown()

    @staticmethod
    def _stack(observations: Any) -> dict[str, np.ndarray]:
        return {name: np.stack([o[name] for o in observations]) for name in observations[0]}


if _gymnasium is not None:
    _gymnasium.register("tileflight/Navigation-v0", entry_point="tileflight.navigation:NavigationEnv")
