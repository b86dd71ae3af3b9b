"""The control step in plain Python: what the compiled one makes, and where a debugger stops."""

import copy
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from pma_gym.envs import PMAEnv
from pma_gym.plant.model import load_model
from pma_gym.plant.sensors import reading

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
