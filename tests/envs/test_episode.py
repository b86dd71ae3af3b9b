"""Rewards, limits, pressures and the actions of an episode."""

import math

import gymnasium as gym
import numpy as np
import pytest

from pma_gym.plant.model import load_model
from pma_gym.tasks import REWARDS, limit_in_words


@pytest.mark.parametrize("reward", sorted(REWARDS))
def test_reward_is_its_formula(make, reward):
    env = make(reward=reward)
    env.reset(seed=0)
    last = -1.0
    for k in range(50):
        action = env.action(0.5 + 0.03 * k)
        _, got, *_, info = env.step(action)
        e = info["error_mm"] / 25.0 * 100.0
        change = abs(action[0] - last)
        last = action[0]
        expected = {
            "absolute": -abs(e),
            "quadratic": -(e**2),
            "gaussian": math.exp(-(e**2)) if e**2 < 12.0 else 0.0,
            "smooth": -abs(e) - 0.1 * change,
        }
        assert got == pytest.approx(expected[reward])


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ({"limits.tension_n": 300.0}, "cable tension above 300 N"),
        ({"limits.stretch_mm": 0.0}, "muscle stretched over 0 mm beyond its resting length"),
        ({"limits.contraction_mm": 30.0}, "contraction above 30 mm"),
        ({"limits.pressure_kpa": 290.0}, "pressure above 290 kPa"),
    ],
)
def test_an_episode_terminates_at_each_limit_and_says_which(make, follow, limit, words):
    env = make(model=load_model("serres2008").replace(limit))
    info = follow(env, lambda time: min(10.0, 4.0 * time))
    assert limit_in_words(env.plant.model, info["limit_code"]) == env.ended_by == words
    assert info["time_s"] < 5.0
    assert info["rmse_mm"] > 0.0


def test_a_terminated_episode_gets_the_reward_of_its_missed_steps(make):
    env = make(model=load_model("serres2008").replace({"limits.tension_n": 100.0}))
    env.reset(seed=0)
    terminated, steps = False, 0
    while not terminated:
        _, reward, terminated, _, info = env.step(env.action(3.0))
        steps += 1
    expected = -abs(info["error_mm"] / 0.25) - 100.0 * (501 - steps)
    assert reward == pytest.approx(expected)


def test_no_step_after_the_end_nor_before_the_start(make, follow):
    env = make(control_rate_hz=10.0)
    with pytest.raises(gym.error.ResetNeeded, match=r"no episode has begun: call reset\(\) before"):
        env.step(env.action(0.0))
    follow(env, lambda time: 0.0)
    with pytest.raises(gym.error.ResetNeeded, match=r"the episode ended at 5\.1 s: call reset\(\)"):
        env.step(env.action(0.0))
    env.reset()
    env.step(env.action(0.0))


def test_actions_and_voltages_are_each_others_inverse(make):
    env = make(regulator_action=True)
    env.reset(seed=0)
    for motor, regulator in ((0.0, 0.0), (3.3, 5.0), (10.0, 10.0)):
        env.step(env.action(motor, regulator))
        assert (env.motor_voltage, env.regulator_voltage) == pytest.approx((motor, regulator))


def test_regulator_action_holds_the_pressure_unless_told_otherwise(make):
    env = make(regulator_action=True)
    env.reset(seed=0)
    for _ in range(50):
        *_, info = env.step(env.action(1.0))
    assert info["pressure_kpa"] == pytest.approx(300.0, abs=1e-6)
    # Zero volts is a command like any other.
    assert env.action(1.0, 0.0)[1] == -1.0
    for _ in range(20):
        *_, info = env.step(env.action(1.0, 0.0))
    assert info["pressure_kpa"] < 150.0
    assert info["extrapolated"]


def test_actions_beyond_their_range_are_held(make):
    env = make()
    env.reset(seed=0)
    observation, *_, info = env.step(np.array([7.0]))
    assert info["motor_voltage_v"] == 10.0
    assert observation[6] == 1.0
    assert env.action(-3.0) == [-1.0]


def test_pressures_are_drawn_as_asked(make):
    def drawn(**options):
        env = make(**options)
        return [env.reset(seed=seed)[1]["pressure_kpa"] for seed in range(30)]

    several = drawn(pressure_kpa=[200.0, 400.0])
    assert set(np.round(several, 6)) == {200.0, 400.0}
    anything = drawn(pressure_kpa="random", task="rotation")
    assert 275.0 <= min(anything) < 350.0 and 500.0 < max(anything) <= 575.0
    assert drawn(pressure_kpa=333) == pytest.approx([333.0] * 30)


def test_reset_options_set_the_pressure_of_one_episode(make):
    env = make()
    _, info = env.reset(seed=0, options={"pressure_kpa": 400})
    assert info["pressure_kpa"] == pytest.approx(400.0)
    assert env.station.pressure == 400e3
    _, info = env.reset(seed=0)
    assert info["pressure_kpa"] == pytest.approx(300.0)


@pytest.mark.parametrize(
    ("task", "pressure", "extrapolated"),
    [
        ("displacement", 150.0, False),
        ("displacement", 575.0, False),
        ("rotation", 274.0, True),
        ("rotation", 275.0, False),
        ("rotation", 150.0, True),
    ],
)
def test_pressures_beyond_the_dissertations_trials_are_flagged(make, task, pressure, extrapolated):
    _, info = make(task, pressure_kpa=pressure).reset(seed=0)
    assert info["extrapolated"] == extrapolated
