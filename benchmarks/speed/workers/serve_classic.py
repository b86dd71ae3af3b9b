"""Gymnasium's own toys: CartPole-v1 (one Euler step of 4 states) and Pendulum-v1 (of 2)."""

import gymnasium as gym

from benchmarks.speed.loops import ACTIONS, BATCHES, Prepared, single, vector

PACKAGES = ("gymnasium", "numpy")


def one(name: str) -> Prepared:
    """An environment as `gym.make` gives it."""
    environment = gym.make(name)
    environment.action_space.seed(0)
    return single(environment, [environment.action_space.sample() for _ in range(ACTIONS)])


def batch(name: str, count: int, mode: str) -> Prepared:
    """Many of them as `gym.make_vec` gives them, one after the other or as one array."""
    environment = gym.make_vec(name, num_envs=count, vectorization_mode=mode)
    environment.action_space.seed(0)
    return vector(environment, [environment.action_space.sample() for _ in range(BATCHES)], count)


ROWS = {"one": one, "batch": batch}
