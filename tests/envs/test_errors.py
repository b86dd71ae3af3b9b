"""Bad input: each error names the thing, the rule, the unit, what came and the mend."""

import math
import re

import gymnasium as gym
import numpy as np
import pytest

from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.plant.model import load_model
from pma_gym.tasks import EVERY_TASK, TASKS, isotonic


def refused(error: type[Exception], *words: str, **options) -> None:
    """The environment refuses options, and says all of these words."""
    with pytest.raises(error) as caught:
        PMAEnv(**({"model": "serres2008"} | options))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("action", "words"),
    [
        (0.3, ["shape (1,)", "motor voltage", "-1 to 1 for 0 to 10 V", "shape ()", "[0.0]"]),
        ([0.1, 0.2], ["shape (1,)", "got shape (2,)", "[0.1, 0.2]"]),
        (np.zeros((1, 1)), ["got shape (1, 1)"]),
        ([np.nan], ["finite", "[nan]", "diverged"]),
        ([np.inf], ["finite", "[inf]"]),
        (["fast"], ["shape (1,)", "['fast']"]),
        ([True], ["shape (1,)", "[True]", "real numbers"]),
        (np.array([0.1 + 0.2j]), ["shape (1,)", "0.1+0.2j", "real numbers"]),
        (None, ["shape (1,)", "None"]),
        ([[1.0], [1.0, 2.0]], ["shape (1,)", "[[1.0], [1.0, 2.0]]"]),
    ],
)
def test_bad_actions_are_refused_and_change_nothing(make, action, words):
    env = make()
    env.reset(seed=0)
    env.step(env.action(1.0))
    state, time = env.condition.state.copy(), env.time
    with pytest.raises(ValueError) as caught:
        env.step(action)
    for word in ("action", *words):
        assert word in str(caught.value)
    np.testing.assert_array_equal(env.condition.state, state)
    assert env.time == time
    env.step(env.action(1.0))


def test_two_actions_are_named(make):
    env = make(regulator_action=True)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"shape \(2,\): motor voltage, regulator voltage"):
        env.step(np.zeros(1))


def test_unknown_options_are_refused_in_pythons_words_with_the_nearest():
    refused(
        TypeError, "PMAEnv.__init__() got an unexpected keyword argument 'presure_kpa'",
        "did you mean 'pressure_kpa'?", presure_kpa=1,
    )  # fmt: skip
    refused(
        TypeError, "got an unexpected keyword argument 'zzz'", "known: pressure_kpa, model", zzz=1
    )
    refused(TypeError, "did you mean 'render_mode'?", render_mod="rgb_array")


@pytest.mark.parametrize(
    ("valid", "task", "drawn"),
    [
        ((0, 800), isotonic(50.0, start_pressures=(50e3, 60e3)), (50.0, 60.0)),
        ((0, 800), TASKS["displacement"], (150.0, 575.0)),
        ((200, 210), TASKS["displacement"], (200.0, 210.0)),
        ((0, 210), EVERY_TASK["isotonic"], (150.0, 210.0)),
    ],
)
def test_start_pressures_are_those_of_the_task_within_the_models_validity(valid, task, drawn):
    ends = {"validity.lowest_kpa": valid[0], "validity.highest_kpa": valid[1]}
    model = load_model("station").replace(ends)
    batch = PMAVectorEnv(32, task, model=model)
    batch.reset(seed=0)
    low, high = drawn
    assert np.all((1e3 * low <= batch.pressures) & (batch.pressures <= 1e3 * high))
    assert np.ptp(batch.pressures) > 500.0 * (high - low)
    chosen = 1e3 * min(valid[1], 500.0)
    env = PMAEnv("displacement", model=model, pressure_kpa=1e-3 * chosen)
    env.reset(seed=0)
    assert env.pressure == chosen
    with pytest.raises(ValueError, match=rf"in {valid[0]}-{valid[1]} kPa .*station.*got 900"):
        env.reset(options={"pressure_kpa": 900})


def test_unknown_models_are_refused_with_the_nearest(tmp_path):
    refused(ValueError, "no model 'seres2008'", "did you mean 'serres2008'?", model="seres2008")
    broken = tmp_path / "broken.toml"
    broken.write_text("schema = ")
    refused(ValueError, str(broken), "not valid TOML", model=str(broken))


def test_bad_reset_options_are_refused_and_the_episode_goes_on(make):
    env = make()
    env.reset(seed=0)
    words = "unknown reset option 'presure' (did you mean 'pressure_kpa'?)"
    with pytest.raises(TypeError, match=re.escape(words)):
        env.reset(options={"presure": 3})
    with pytest.raises(ValueError, match=r"150-575 kPa .*, got 900"):
        env.reset(options={"pressure_kpa": 900})
    env.step(env.action(0.0))


def test_render_says_what_is_missing(make):
    env = make(render_mode="rgb_array")
    with pytest.raises(gym.error.ResetNeeded, match=r"call reset\(\) before render\(\)"):
        env.render()
    env = make()
    env.reset(seed=0)
    with pytest.warns(UserWarning, match='render_mode="rgb_array"'):
        assert env.render() is None


DELAY = ["0-1 s", "whole number of control steps of 0.01 s", "0.015 s = 1.5 steps", "change it or"]
PRESSURES = 'pressure_kpa must be a number in kPa, a list of numbers or "random"'
LOW = isotonic(start_pressures=(50, 60), name="low")
REFUSED = [
    *(("pressure_kpa", bad, ["150-575 kPa"]) for bad in (149.9, 576, float("nan"), [300, 700.0])),
    *(
        ("pressure_kpa", bad, [PRESSURES])
        for bad in (
            *("high", [], None, [300, "random"], True, {"kpa": 3}, {300.0, 200.0}, [[200], [300]]),
            *(np.array([]), b"300", np.array([True, False]), np.array(["300"]), np.zeros((2, 2))),
        )
    ),
    *(
        ("control_rate_hz", bad, ["1-10000 Hz"])
        for bad in (0, -100.0, 20000.0, "100", None, True, float("inf"))
    ),
    *(
        (name, bad, words)
        for name in ("action_delay_s", "observation_delay_s")
        for bad, words in ((-0.1, DELAY[:1]), ("10 ms", DELAY[:1]), (0.015, DELAY[1:]))
    ),
    *(
        (name, bad, ["whole number of control steps in 0-1000"])
        for name in ("preview", "history")
        for bad in (-1, 1.5, 1001, "3", True, np.True_)
    ),
    *(
        (name, bad, ["must be true or false"])
        for name in ("noise", "regulator_action")
        for bad in (1, "yes", None)
    ),
    ("reward", "absolut", ["must be one of", "did you mean 'absolute'?"]),
    ("randomisation", "interval", ["must be one of", "did you mean 'intervals'?"]),
    *(("randomisation", bad, ["randomisation must be one of"]) for bad in (3, None, "wide open")),
    ("task", "Displacement", ["must be one of", "did you mean 'displacement'?"]),
    ("task", LOW, ["task low begins at 0.05-0.06 kPa", "valid at 150-575 kPa", "(Pa)"]),
    ("render_mode", "rgb", ["must be one of", "did you mean 'rgb_array'?"]),
    ("reward", 3, ["must be one of absolute, quadratic"]),
    ("model", 3, ["model must be", "a shipped model's name"]),
    *(
        ("reward_scale", bad, ["must be a number above 0 and up to 1e9"])
        for bad in (0.0, -1.0, math.nan, math.inf, "2", None, True, 1e10)
    ),
    *(
        ("tolerance", bad, ["share in 1e-10 to 0.1 of the states' scales", "the default is"])
        for bad in (0.0, -1e-3, 0.2, 1e-11, float("nan"), 10**400, "1e-3", None, True)
    ),
    *(
        ("render_width", bad, ["must be a multiple of 4 in 400-3200 pixels"])
        for bad in (0, 396, 402, 3204, 800.0, True, "800")
    ),
    *(
        ("max_episode_steps", bad, ["must be a whole number of con"])
        for bad in (0, -1, -7, 2.5, True, "10", np.float64(3.0))
    ),
]


def test_bad_values_are_refused_by_name_rule_and_what_came():
    for name, bad, words in REFUSED:
        came = [] if name == "task" or isinstance(bad, np.ndarray) else ["got "]
        refused(ValueError, name, *words, *came, **{name: bad})
    PMAEnv(LOW, pressure_kpa=300).reset(seed=0)


@pytest.mark.parametrize(
    ("drawn", "words"),
    [
        (lambda nominal: nominal.with_effects({"hanging_load": {}}), "these differ: hanging_load;"),
        (lambda nominal: None, "a randomisation must give a Model, got None"),
    ],
)
def test_what_a_randomisation_may_not_draw_is_refused(drawn, words):
    env = PMAEnv(randomisation=lambda nominal, generator: drawn(nominal), pressure_kpa=300.0)
    with pytest.raises(ValueError, match=words):
        env.reset(seed=0)
