"""What a step returns is made in compiled code: as Python would make it, and nobody else's."""

import gc
import sys
import weakref

import numpy as np
import pytest

from pma_gym.codegen.machine import control
from pma_gym.engine.cpu.python_step import NOT_READ
from pma_gym.engine.engine import Engine
from pma_gym.engine.options import parse_options
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import load_model
from pma_gym.tasks import TASKS


@pytest.mark.parametrize(
    ("name", "ends"),
    [
        ("displacement", "truncated"),
        ("isotonic", "terminated"),
        ("profile_exercise", "truncated"),
    ],
)
def test_every_info_has_the_same_keys_types_and_no_score_before_the_last(name, ends):
    limits = load_model("station").replace({"limits.pressure_kpa": 1.0})
    env = PMAEnv(name, max_episode_steps=4, **({"model": limits} if ends == "terminated" else {}))
    infos, over = [env.reset(seed=1)[1]], False
    while not over:
        *_, terminated, truncated, info = env.step(np.full(1, -0.5))
        over = terminated or truncated
        infos.append(info)
    assert {"truncated": truncated, "terminated": terminated}[ends]
    kinds = {key: np.int64 if key == "limit_code" else np.float64 for key in infos[0]}
    for info in infos:
        assert {key: type(value) for key, value in info.items()} == kinds
    score = f"rmse_{env.task.schedule.suffix}"
    assert [info[score] > 0.0 for info in infos] == [False] * (len(infos) - 1) + [True]
    assert infos[-1]["limit_code"] == (4 if ends == "terminated" else 0)


@pytest.mark.parametrize("task", ["displacement", "isotonic", "profile_exercise"])
def test_a_step_returns_what_the_record_holds(task):
    env = PMAEnv(task)
    _, begun = env.reset(seed=1)
    entries = env.action_space.shape
    seen = []
    for k in range(3):
        made = env.step(np.full(entries, 0.01 * k, np.float32))
        observation, reward, terminated, truncated, info = made
        assert type(made) is tuple and type(info) is dict
        assert terminated is False and truncated is False
        assert list(info) == list(begun)
        np.testing.assert_equal(info, env._info())
        assert type(reward) is float and reward == env._engine.rewards[0]
        np.testing.assert_array_equal(observation, env._observed)
        assert observation.base is None
        seen.append((observation, info["time_s"]))
    # None is written over by the next.
    assert [time for _, time in seen] == [0.01, 0.02, 0.03]
    assert not np.array_equal(seen[0][0], seen[1][0])


def test_steps_keep_nothing_and_take_no_reference_that_is_not_theirs():
    env = PMAEnv("displacement")
    env.reset(seed=0)
    action = np.zeros(1, np.float32)
    keys = env._engine.state_layout.info
    held = [False, *keys, env._observed]
    env.step(action)
    gc.collect()
    before, objects = [sys.getrefcount(one) for one in held], len(gc.get_objects())
    for _ in range(100):
        _, _, _, _, info = env.step(action)
        assert all(sys.getrefcount(info[key]) <= 4 for key in keys)
        del info
    after = [sys.getrefcount(one) for one in held]
    assert np.abs(np.subtract(after, before)).max() <= 5
    gc.collect()
    assert abs(len(gc.get_objects()) - objects) <= 5


def test_what_goes_wrong_while_it_is_made_is_raised():
    engine = Engine(TASKS["displacement"], parse_options({}))
    engine.seed(np.array([0]), [0])
    engine.reset(np.array([0]))

    def fail():
        raise MemoryError("no room for an observation")

    with pytest.raises(MemoryError, match="no room"):
        engine.advance(fail, engine.actions[0], {})(np.zeros(1))
    # The step itself was made.
    assert engine.counts().tolist() == [1]
    assert engine.advance(lambda: "seen", engine.actions[0], {})(np.zeros(1))[0] == "seen"


def _behind_a_byte(values):
    """An array that begins at an odd address."""
    room = np.zeros(8 * len(values) + 1, np.uint8)[1:].view(np.float64)
    room[:] = values
    return room


READ = ("single", "double", "every second entry", "from behind", "one number for all")
READ += "at an odd address", "read-only"
"""Forms that compiled code reads by itself."""

FORMS = {
    "single": lambda values: np.array(values, np.float32),
    "double": lambda values: np.array(values),
    "every second entry": lambda values: np.repeat(values, 2)[::2],
    "from behind": lambda values: np.array(values[::-1], np.float32)[::-1],
    "one number for all": lambda values: np.broadcast_to(np.float32(values[0]), len(values)),
    "at an odd address": _behind_a_byte,
    "read-only": lambda values: np.frombuffer(np.array(values).tobytes()),
    "bytes in the other order": lambda values: np.array(values, ">f4"),
    "half": lambda values: np.array(values, np.float16),
    "list": list,
    "tuple of NumPy's numbers": lambda values: tuple(np.array(values)),
}


@pytest.mark.parametrize("known", [True, False], ids=["read here", "read in Python"])
@pytest.mark.parametrize("form", FORMS)
def test_an_action_is_its_numbers_in_whatever_form(monkeypatch, form, known):
    monkeypatch.setattr(control, "are_known", lambda: known)
    env = PMAEnv("displacement", regulator_action=True)
    env.reset(seed=1)
    values = [0.25, 0.25] if form == "one number for all" else [0.25, -0.5]
    env.step(FORMS[form](values))
    assert env._given.tolist() == values
    given = env._engine.records.copy()
    env.reset(seed=1)
    env.step(np.array(values))
    np.testing.assert_array_equal(env._engine.records, given)
    made = env._made(FORMS[form](values))
    assert type(made) is tuple if form in READ and known else made == NOT_READ


def test_an_action_may_be_the_array_that_keeps_it():
    env = PMAEnv("displacement")
    env.reset(seed=1)
    env._given[:] = 0.5
    env.step(env._given)
    assert env.motor_voltage == 7.5


def test_an_environment_is_freed_when_nobody_has_it():
    gc.disable()
    try:
        for episodes in range(2):
            env = PMAEnv("displacement")
            for _ in range(episodes):
                env.reset(seed=1)
                env.step(np.zeros(1, np.float32))
            gone = weakref.ref(env)
            del env
            assert gone() is None
    finally:
        gc.enable()
