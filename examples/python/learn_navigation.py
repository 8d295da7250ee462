"""A drone learns to fly to a goal through the built-in stadium, in about a minute (two cores): the cross-entropy method over a linear
policy, with numpy alone (Rubinstein and Kroese, The Cross-Entropy Method, 2004).

    python3 examples/python/learn_navigation.py [TILESET] [--picture learning.png]
"""

import argparse
import pathlib
import tempfile

import numpy as np

import tileflight as tf
from tileflight.navigation import NavigationEnv

GENERATIONS, POPULATION, ELITE, EPISODES = 10, 30, 6, 2


def features(observation):
    """Goal's direction, how near surfaces are in the left, middle and right of the view, and a constant."""
    goal = observation["goal"]
    depth = observation["image"][:, :, 0]
    near = [1.0 / np.maximum(np.min(part), 1.0) for part in np.array_split(depth, 3, axis=1)]
    return np.concatenate([goal / (np.linalg.norm(goal) + 1e-6), near, [1.0]])


def episode(env, policy, seed):
    observation, _ = env.reset(seed=seed)
    total = 0.0
    while True:
        action = np.tanh(policy @ features(observation))
        observation, reward, terminated, truncated, info = env.step(action)
        total += reward
        if terminated or truncated:
            return total, info["is_success"]


def learn(env, seed=0):
    random = np.random.default_rng(seed)
    shape = (4, 7)
    mean, spread = np.zeros(shape), np.ones(shape)
    history = []
    for generation in range(GENERATIONS):
        policies = mean + spread * random.standard_normal((POPULATION, *shape))
        seeds = [1000 * generation + k for k in range(EPISODES)]
        returns = np.array([np.mean([episode(env, p, s)[0] for s in seeds]) for p in policies])
        best = policies[np.argsort(returns)[-ELITE:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.1
        history.append((returns.mean(), returns.max()))
        print(f"generation {generation + 1}: mean return {returns.mean():7.1f}, best {returns.max():7.1f}", flush=True)
    return mean, np.array(history)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tileset", nargs="?", help="default: the built-in stadium, made for the occasion")
    parser.add_argument("--picture", type=pathlib.Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tileset = arguments.tileset
        if tileset is None:
            tf.make_stadium(out=f"{folder}/stadium")
            tileset = f"{folder}/stadium/twin"
        env = NavigationEnv(tileset, size=(32, 18), step_s=0.2, max_steps=60, distance=(15, 30))
        policy, history = learn(env)

        def arrived(policy):
            return sum(episode(env, policy, 10**6 + k)[1] for k in range(20))

        untrained = np.random.default_rng(0).standard_normal(policy.shape)
        print(f"{arrived(policy)} of 20 new flights arrive, of an untrained policy {arrived(untrained)}")
    if arguments.picture:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
        axes.plot(range(1, len(history) + 1), history[:, 1], label="best policy")
        axes.plot(range(1, len(history) + 1), history[:, 0], label="mean of all")
        axes.set(xlabel="generation", ylabel="return (metres nearer, +10 at the goal)")
        axes.legend()
        axes.grid(alpha=0.3)
        figure.savefig(arguments.picture, dpi=120)


if __name__ == "__main__":
    main()
