"""Environments on every shipped model."""

from collections.abc import Callable

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.plant.model import Model, load_model


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


def _squared(error, change, position, reference):
    """A reward of a user's own."""
    return -(error**2) - change


EVERYTHING = {
    "task": "rotation", "model": "station", "pressure_kpa": "random", "randomisation": "varied",
    "disturbances": "regulator_and_hand_push", "action_delay_s": 0.1, "observation_delay_s": 0.2,
    "history": 2, "preview": 3, "regulator_action": True, "reward": _squared,
    "max_episode_steps": 60,
}  # fmt: skip
"""Nearly all that a state depends on."""
SINGLES = [
    {},
    EVERYTHING,
    {
        "task": "displacement_multisine_3",
        "model": "cascade",
        "reference": "random",
        "tolerance": 1e-3,
        "noise": False,
    },
    {
        "task": "profile_exercise",
        "model": "station",
        "pressure_kpa": "random",
        "control_rate_hz": 50.0,
        "randomisation": "intervals",
        "disturbances": "regulator",
        "safety": False,
    },
]
BATCHES = [
    {"autoreset_mode": mode, "threads": threads, "precision": precision}
    for mode, threads, precision in [
        (AutoresetMode.NEXT_STEP, 1, "double"),
        (AutoresetMode.SAME_STEP, 3, "single"),
        (AutoresetMode.DISABLED, 2, "double"),
    ]
]


@pytest.fixture(params=SINGLES, ids=lambda options: ",".join(options) or "defaults")
def options(request) -> dict:
    """Options of single environments, of every kind that a state depends on."""
    return request.param


@pytest.fixture(params=BATCHES, ids=lambda options: "-".join(map(str, options.values())))
def batch_options(request, fragile) -> dict:
    """Options of batches: every autoreset mode, threads and precisions, ends of both kinds."""
    made = {"control_rate_hz": 10.0, "model": fragile, "pressure_kpa": [250.0, 300.0]}
    return request.param | made


def _single(options: dict) -> PMAEnv:
    """An environment at 300 kPa and 10 Hz, unless told otherwise."""
    usual = {"model": "serres2008", "pressure_kpa": 300.0, "control_rate_hz": 10.0}
    return PMAEnv(**(usual | options))


def _course(env, steps: int = 12, seed: int = 5) -> list:
    """What an environment gives in some steps, across an episode's end and the next reset."""
    generator, seen = np.random.default_rng(seed), []
    for _ in range(steps):
        if env.unwrapped._idle is not None:
            seen.append(env.reset())
        size = env.action_space.shape[0]
        seen.append(env.step(generator.uniform(-1.0, 1.0, size)))
    return seen


def _batch_course(envs, steps: int = 12, seed: int = 5) -> list:
    """What environments give in some steps."""
    generator, seen = np.random.default_rng(seed), []
    disabled = envs.metadata["autoreset_mode"] == AutoresetMode.DISABLED
    over = np.zeros(envs.num_envs, np.bool_)
    if envs._waiting is not None:
        over[envs._waiting] = True
    for _ in range(steps):
        if disabled and over.any():
            seen.append(envs.reset(options={"reset_mask": over}))
        seen.append(envs.step(generator.uniform(-1.0, 1.0, envs.action_space.shape)))
        over = seen[-1][2] | seen[-1][3]
    return seen


def _same(first: object, second: object) -> bool:
    """Whether two values have the same bits, whatever they consist of."""
    if isinstance(first, np.ndarray) and first.dtype.kind == "O":
        return first.shape == second.shape and all(map(_same, first, second))
    if isinstance(first, np.ndarray):
        return first.dtype == second.dtype and first.tobytes() == second.tobytes()
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(_same(first[k], second[k]) for k in first)
    if isinstance(first, tuple | list):
        return len(first) == len(second) and all(map(_same, first, second))
    return repr(first) == repr(second)


@pytest.fixture
def single() -> Callable[[dict], PMAEnv]:
    """Makes an environment of some options."""
    return _single


@pytest.fixture
def course() -> Callable[..., list]:
    """Steps an environment; what it gives."""
    return _course


@pytest.fixture
def batch_course() -> Callable[..., list]:
    """Steps a batch; what it gives."""
    return _batch_course


@pytest.fixture
def same() -> Callable[[object, object], bool]:
    """Whether two values have the same bits."""
    return _same
