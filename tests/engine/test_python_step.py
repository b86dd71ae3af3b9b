"""What a step returns is made in compiled code: as Python would make it, and nobody else's.

The control step in plain Python: what the compiled one makes, and where a debugger stops.
"""

import copy
import gc
import re
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest

from pma_gym.codegen.machine import control
from pma_gym.engine.cpu.python_step import NOT_READ
from pma_gym.engine.engine import Engine
from pma_gym.engine.options import parse_options
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import load_model
from pma_gym.plant.sensors import reading
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


EXAMPLE = re.compile(r"## The control step.*?```python\n(.*?)```", re.DOTALL)


def stepped(env, steps, action=None):
    """Observations, rewards, ends and infos of some steps, as rows; position and voltages."""
    generator, rows = np.random.default_rng(0), []
    over = False
    while not over and len(rows) < steps:
        drawn = generator.uniform(-1.0, 1.0, env.action_space.shape)
        seen, reward, terminated, truncated, info = env.step(drawn if action is None else action)
        rows.append([*seen, reward, terminated, truncated, *info.values()])
        over = terminated or truncated
    return np.array(rows, float), env.trajectory(), env.voltages


@pytest.mark.parametrize(
    ("task", "steps", "options"),
    [
        ("displacement", 50, {"action_delay_s": 0.02, "history": 2, "preview": 1}),
        ("rotation", 50, {"disturbances": "regulator_and_hand_push", "regulator_action": True}),
        ("isotonic", 50, {"observation_delay_s": 0.03, "randomisation": "varied"}),
        ("displacement_speeds", 20, {"reference": "random", "preview": 2}),
        ("displacement_steps", 5, {"reward": lambda e, a, p, r: a - e * e, "noise": False}),
        ("profile_exercise", 5, {"reward": "smooth", "max_episode_steps": 4}),
    ],
)
def test_the_steps_are_the_compiled_ones_to_roundings(task, steps, options):
    made = []
    for compiled in (True, False):
        env = PMAEnv(task, compiled=compiled, **options)
        env.reset(seed=3)
        made.append(stepped(env, steps))
    for fast, slow in zip(*made, strict=True):
        np.testing.assert_allclose(slow, fast, rtol=1e-9, atol=1e-12)


def test_an_episode_goes_on_from_a_compiled_one_and_terminates_with_it():
    model = load_model("station").replace({"limits.stretch_mm": 2.0})
    fast, slow = (PMAEnv(model=model, pressure_kpa=200, compiled=each) for each in (True, False))
    fast.reset(seed=1)
    early, full = fast.get_state(), fast.action(10.0)
    rows, *_ = stepped(fast, 50, full)
    assert 2 < len(rows) < 50 and fast.ended_by
    fast.set_state(early)
    stepped(fast, len(rows) - 2, full)
    slow.set_state(fast.get_state())
    for env in (slow, copy.deepcopy(slow)):
        ends, *_ = stepped(env, 50, full)
        np.testing.assert_allclose(ends, rows[-2:], rtol=1e-9, atol=1e-12)
        assert env.ended_by.startswith("muscle stretched")


def test_the_example_of_the_documentation_stops_in_a_law(capsys):
    page = Path(__file__).parents[2] / "docs" / "development" / "compiled-code.md"
    (example,) = EXAMPLE.findall(page.read_text(encoding="utf-8"))
    exec(example, names := {"__name__": "example"})
    assert "tension()" in (printed := capsys.readouterr().out)
    assert re.search(r"stretch = <real \d+: -?\d", printed)
    assert names["env"].time == pytest.approx(0.01)


def test_python_calls_every_sensor_and_none_in_compiled_code():
    for compiled, readings in ((True, 0), (False, 4)):
        env, called = PMAEnv("displacement", compiled=compiled), []
        env.reset(seed=1)
        sys.setprofile(lambda frame, event, _, called=called: called.append((event, frame.f_code)))
        env.step(env.action(2.0))
        sys.setprofile(None)
        assert called.count(("call", reading.__code__)) == readings


def test_compiled_must_be_a_truth():
    with pytest.raises(ValueError, match="compiled must be true or false, got 'no'"):
        PMAEnv("displacement", compiled="no")  # type: ignore[arg-type]
