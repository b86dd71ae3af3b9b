"""Environments on every shipped model."""

from collections.abc import Callable

import numpy as np
import pytest

from pma_gym.envs import PMAEnv
from pma_gym.plant.model import shipped_models


@pytest.fixture(params=sorted(shipped_models()))
def model(request) -> str:
    """Every shipped model."""
    return request.param


@pytest.fixture
def make() -> Callable[..., PMAEnv]:
    """An environment at 300 kPa on the dissertation's numbers, unless told otherwise."""

    def made(task: str = "displacement", **options) -> PMAEnv:
        return PMAEnv(task, **({"model": "serres2008", "pressure_kpa": 300.0} | options))

    return made


@pytest.fixture
def follow() -> Callable[..., dict]:
    """Runs an episode to its end under voltages by time; returns its last info."""

    def followed(env: PMAEnv, volts: Callable[[float], float], seed: int = 0) -> dict:
        env.reset(seed=seed)
        for _ in range(100_000):
            *_, terminated, truncated, info = env.step(env.action(volts(env.time)))
            if terminated or truncated:
                return info
        raise AssertionError("the episode never ended")

    return followed


@pytest.fixture
def ramp() -> Callable[[float], float]:
    """A voltage that pulls the muscle out and lets it go, in steps of 0.25 s."""
    return lambda time: 4.0 * float(np.sin(np.floor(time * 4.0) / 4.0 * 0.6)) ** 2
