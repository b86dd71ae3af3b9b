"""This package: single environments, batches, its integrator's steps, starts, fits.

What differs between versions of the package is in `hooks`.
"""

import multiprocessing
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

import gymnasium as gym
import numpy as np

import pma_gym.envs  # noqa: F401 - registers the environments
from benchmarks.speed.core import core
from benchmarks.speed.loops import ACTIONS, BATCHES, Missing, Prepared, single, vector
from benchmarks.speed.starts import start
from benchmarks.speed.workers import hooks

PACKAGES = ("pma-gym", "gymnasium", "numpy", "scipy")

HELD = -0.4
"""The action of rows that glide: 3 V, held."""


def actions(shape: tuple[int, ...], held: bool) -> np.ndarray:
    """Actions drawn beforehand, uniform in the action space; or one and the same."""
    if held:
        return np.full(shape, HELD, np.float32)
    return np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)


def one(name: str, held: bool = False) -> Prepared:
    """An environment as `gym.make` gives it: sensors, noise, reward, checks of Gymnasium."""
    environment = gym.make(name)
    environment.reset(seed=0)
    prepared = single(environment, list(actions((ACTIONS, 1), held)))
    if held:
        # Evaluations are counted under random actions.
        return prepared
    return Prepared(prepared.chunk, lambda: _evaluations(environment.unwrapped))


def kernel(name: str) -> Prepared:
    """Control steps of one environment without Python between them."""
    return hooks.single_kernel(name)


def batch(name: str, count: int, threads: int, held: bool = False) -> Prepared:
    """Many environments as `gym.make_vec` gives them."""
    if gym.spec(name).vector_entry_point is None:
        raise Missing("this version has no vector environment")
    environment = gym.make_vec(
        name, num_envs=count, vectorization_mode="vector_entry_point", threads=threads
    )
    environment.reset(seed=0)
    prepared = vector(environment, actions((BATCHES, count, 1), held), count)
    if held:
        return prepared
    return Prepared(prepared.chunk, lambda: _evaluations(environment.unwrapped))


def pair(name: str, count: int) -> Prepared:
    """As many environments in each of two processes, which share nothing but the machine.

    Of two threads no more than about that can be asked for.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    other = context.Process(target=_beside, args=(there, name, count), daemon=True)
    other.start()
    # Whoever waits for a process that has ended is told so.
    there.close()
    own = batch(name, count, 1)

    def chunk() -> int:
        try:
            here.send("go")
            steps = sum(own.chunk() for _ in range(PAIRED))
            here.send("stop")
            return steps + here.recv()
        except (EOFError, OSError):
            other.join()
            raise RuntimeError("the other process has ended") from None

    return Prepared(chunk, own.facts)


PAIRED = 64
"""Chunks for which the other process is told to go on once."""


def _beside(connection: Connection, name: str, count: int) -> None:
    """The other process: steps while it is told to, and says how many it made."""
    own = batch(name, count, 1)
    with suppress(EOFError, OSError):
        while connection.recv():
            steps = 0
            while not connection.poll():
                steps += own.chunk()
            connection.recv()
            connection.send(steps)


def _evaluations(environment: Any) -> dict[str, float]:  # noqa: ANN401 - of either kind
    return {"right_hand_sides": hooks.right_hand_sides_per_step(environment)}


ROWS = {
    "core": core,
    "one": one,
    "kernel": kernel,
    "batch": batch,
    "pair": pair,
    "start": start,
    "fits": hooks.joint_fits,
}
