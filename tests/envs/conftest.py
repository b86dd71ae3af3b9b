"""Environments on every shipped model."""

from collections.abc import Callable

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.plant.model import Model, load_model, shipped_models


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
def batch() -> Callable[..., PMAVectorEnv]:
    """Environments at 300 kPa and 10 Hz on the dissertation's numbers, unless told otherwise."""
    made = {"model": "serres2008", "pressure_kpa": 300.0, "control_rate_hz": 10.0}
    return lambda count=3, **options: PMAVectorEnv(count, **(made | options))


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


class Twins:
    """A batch, and Gymnasium's own loop over single environments of the same options.

    Args:
        count: how many environments.
        task: the task.
        autoreset_mode: of both.
        batch: options of the batch alone.
        pressures_kpa: one for each environment, if they differ.
        options: of both.
    """

    def __init__(
        self, count, task="displacement", autoreset_mode="NextStep", batch=None,
        pressures_kpa=None, **options,
    ) -> None:  # fmt: skip
        options = {"model": "serres2008", "control_rate_hz": 10.0} | options
        singles = [options] * count
        if pressures_kpa is not None:
            singles = [options | {"pressure_kpa": p} for p in pressures_kpa]
            batch = (batch or {}) | {"pressures_kpa": pressures_kpa}
        self.batch = PMAVectorEnv(
            count, task, autoreset_mode=autoreset_mode, **(batch or {}), **options
        )
        self.loop = SyncVectorEnv(
            [lambda given=given: PMAEnv(task, **given) for given in singles],
            autoreset_mode=autoreset_mode,
        )
        self.generator = np.random.default_rng(count)
        self.ends = np.zeros((2, count), int)

    def reset(self, **given) -> None:
        """Reset both, and compare."""
        options = given.pop("options", None)
        ours, info = self.batch.reset(options=options, **given)
        # The loop takes options out of what it is given.
        theirs, its_info = self.loop.reset(options=options and dict(options), **given)
        np.testing.assert_array_equal(ours, theirs)
        assert ours.dtype == theirs.dtype and info == {}
        mask = np.ones(len(ours), bool) if not options else options.get("reset_mask")
        same_info(self.batch.station_info(), its_info, mask, masks=False)

    def step(self, low=-1.0, high=1.0) -> np.ndarray:
        """Step both by random actions, and compare everything; return which episodes are over."""
        shape = self.batch.action_space.shape
        actions = self.generator.uniform(low, high, shape).astype(np.float32)
        *ours, info = self.batch.step(actions)
        *theirs, its_info = self.loop.step(actions)
        for mine, its in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(mine, its)
            assert mine.dtype == its.dtype
        terminated, truncated = ours[2:]
        over = terminated | truncated
        self.ends += [terminated, truncated]
        if not over.any():
            assert info == {}
        elif self.batch.autoreset_mode == AutoresetMode.SAME_STEP:
            assert set(info) == {"final_obs", "_final_obs", "final_info", "_final_info"}
            for i in np.flatnonzero(over):
                np.testing.assert_array_equal(info["final_obs"][i], its_info["final_obs"][i])
            assert [one is not None for one in info["final_obs"]] == over.tolist()
            for name in ("_final_obs", "_final_info"):
                np.testing.assert_array_equal(info[name], its_info[name])
            same_info(info["final_info"], its_info["final_info"], over)
        else:
            same_info(info, its_info, over)
        same_info(self.batch.station_info(), its_info, np.ones(len(over), bool), masks=False)
        return over


def same_info(ours, theirs, over, masks=True) -> None:
    """Values of the environments in a mask are the same, bit for bit."""
    names = [name for name in ours if not name.startswith("_")]
    if masks:
        assert set(names) == {name for name in theirs if not name.startswith("_")}
    for name in names:
        mine, its = ours[name], theirs[name]
        if isinstance(mine, dict):
            same_info(mine, its, over, masks)
            continue
        known = over
        if masks:
            # What every step has, the loop tells of all environments.
            known = ours[f"_{name}"]
            np.testing.assert_array_equal(known, theirs[f"_{name}"] & over)
        assert mine.dtype == its.dtype and mine.shape == its.shape
        np.testing.assert_array_equal(mine[known], its[known], err_msg=name)


@pytest.fixture
def twins() -> type[Twins]:
    """Makes a batch beside Gymnasium's own loop over single environments."""
    return Twins


@pytest.fixture(scope="session")
def fragile() -> Model:
    """A model whose episodes soon break a limit."""
    return load_model("serres2008").replace({"limits.tension_n": 450.0})
