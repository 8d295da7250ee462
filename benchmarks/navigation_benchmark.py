"""Steps and resets a second of the navigation environment, and images a second of a Renderer, from Python.

    PYTHONPATH=build/release/python python3 benchmarks/navigation_benchmark.py TILESET [--seconds 10]
"""

import argparse
import time

import numpy as np

import tileflight as tf
from tileflight.navigation import NavigationEnv, VectorNavigationEnv


def rate(work, seconds):
    """Calls of `work` a second, wall clock and processor time."""
    work()
    begin, begin_cpu, count = time.perf_counter(), time.process_time(), 0
    while time.perf_counter() - begin < seconds:
        work()
        count += 1
    return count / (time.perf_counter() - begin), 1000 * (time.process_time() - begin_cpu) / count


def step_of(env, actions):
    def step():
        _, _, terminated, truncated, _ = env.step(next(actions))
        if np.ndim(terminated) == 0 and (terminated or truncated):
            env.reset()

    return step


def random_actions(shape):
    random = np.random.default_rng(1)
    while True:
        yield random.uniform(-0.5, 0.5, shape)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tileset")
    parser.add_argument("--seconds", type=float, default=10.0)
    arguments = parser.parse_args()
    scene = tf.load(arguments.tileset)
    print(f"{scene.triangles} triangles\n\n| work | a second | CPU ms each |\n| --- | --- | --- |")

    def report(name, work, per_call=1):
        calls, cpu_ms = rate(work, arguments.seconds)
        print(f"| {name} | {calls * per_call:.0f} | {cpu_ms / per_call:.2f} |", flush=True)

    for observation in ("depth", "rgb", "lidar"):
        env = NavigationEnv(scene, observation=observation)
        env.reset(seed=1)
        report(f"steps, {observation} 128 x 72", step_of(env, random_actions(4)))
        report(f"resets, {observation} 128 x 72", env.reset)
        env.close()
    envs = VectorNavigationEnv(scene, 2)
    envs.reset(seed=1)
    report("steps of two at once, depth 128 x 72", step_of(envs, random_actions((2, 4))), per_call=2)
    envs.close()

    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = (scene.bounds[0] + scene.bounds[1]) / 2 + [0, 0, 40]
    renderer = tf.Renderer(scene, tf.Camera.pinhole(640, 480, 90))
    report("images with depth, 640 x 480", lambda: renderer.render(pose))


if __name__ == "__main__":
    main()
