"""Tasks: scores, rewards, limits."""

import math

import numpy as np
import pytest

from pma_gym.data.protocol import DISPLACEMENT, ROTATION
from pma_gym.metrics import phase_times
from pma_gym.plant.model import load_model
from pma_gym.tasks import (
    REWARDS,
    TASKS,
    TRIAL_TAIL_S,
    broken,
    broken_limit,
    limit_in_words,
    missed_reward,
    phase_errors,
    phase_rmse,
)

SAMPLES = {"displacement": 1923, "rotation": 5763}


def ideal(name: str) -> np.ndarray:
    return TASKS[name].protocol.reference(np.arange(SAMPLES[name]) / 384.0)


def test_a_trial_lasts_to_its_last_sample():
    assert TRIAL_TAIL_S == pytest.approx(2 / 384)
    assert TASKS["displacement"].duration == pytest.approx(phase_times()[-1])
    assert TASKS["rotation"].duration == pytest.approx(phase_times(2)[-1])


@pytest.mark.parametrize("name", TASKS)
def test_the_ideal_has_no_error_but_past_the_ends_of_ramps(name):
    # A phase is scored on its own line, the reference turns: two samples of 5 ms are beyond.
    for phase, error in phase_errors(TASKS[name].protocol, ideal(name)).items():
        assert len(error) == 1923
        np.testing.assert_allclose(error[:1921], 0.0, atol=1e-12, err_msg=phase)


def test_a_constant_offset_is_the_rmse_of_every_phase():
    times = np.arange(5763) / 384.0
    offset = np.full_like(times, 0.01)
    known = phase_rmse(ROTATION, ROTATION.reference(times) + offset)
    assert list(known) == ["I", "II", "III", "all"]
    assert list(known.values()) == pytest.approx([0.01] * 4, rel=1e-2)


def test_phases_not_begun_are_left_out():
    assert list(phase_rmse(ROTATION, np.zeros(1000))) == ["I", "all"]
    assert list(phase_rmse(ROTATION, np.zeros(1921))) == ["I", "II", "all"]
    assert phase_rmse(DISPLACEMENT, np.zeros(1)) == {"displacement": 0.0, "all": 0.0}


def test_standing_still_misses_by_the_ramps_own_root_mean_square():
    # Root mean square of a line from 0 to 25 mm: 25 / sqrt(3).
    known = phase_rmse(DISPLACEMENT, np.zeros(1923))
    assert known["all"] == pytest.approx(0.025 / math.sqrt(3.0), rel=2e-3)


def test_rewards_are_best_without_an_error_and_even():
    for reward in REWARDS.values():
        assert reward(0.0, 0.0) == max(reward(e, 0.0) for e in np.linspace(-5, 5, 11))
        assert reward(1.7, 0.2) == reward(-1.7, 0.2)
        assert reward(2.0, 0.0) < reward(1.0, 0.0)


def test_a_missed_step_is_worth_no_more_than_the_worst_that_follows():
    for reward in REWARDS.values():
        assert missed_reward(reward) <= min(reward(e, 0.0) for e in np.linspace(-100, 100, 21))


def test_errors_are_given_in_percent_of_the_range():
    assert TASKS["displacement"].error_percent(0.25e-3) == pytest.approx(1.0)
    assert TASKS["rotation"].error_percent(math.radians(0.9)) == pytest.approx(1.0)


SAFE = {"contraction": 0.04, "load": 300.0, "pressure": 300e3}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, None),
        ({"contraction": 0.0701}, "contraction above 70 mm"),
        ({"contraction": -0.0121}, "muscle stretched over 12 mm beyond its resting length"),
        ({"load": 1301.0}, "cable tension above 1300 N"),
        ({"pressure": 601e3}, "pressure above 600 kPa"),
        ({"contraction": math.nan}, "contraction above 70 mm"),
        ({"load": math.nan}, "cable tension above 1300 N"),
    ],
)
def test_limits_are_named(change, words):
    assert broken_limit(load_model("serres2008"), SAFE | change) == words


def test_the_first_limit_that_is_broken_counts():
    model = load_model("serres2008")
    limits = model.parameters["limits"]
    assert broken(limits, SAFE) == 0.0 and limit_in_words(model, 0.0) is None
    all_of_them = {"contraction": 0.08, "load": 2000.0, "pressure": 700e3}
    assert broken(limits, all_of_them) == 1.0
    assert broken(limits, all_of_them | {"contraction": 0.04}) == 3.0
    assert broken(limits, SAFE | {"pressure": 700e3}) == 4.0
    assert limit_in_words(model, 4.0) == "pressure above 600 kPa"


def test_the_gaussian_reward_ends_where_next_to_nothing_is_left():
    reward = REWARDS["gaussian"]
    assert reward(1.0, 0.0) == pytest.approx(math.exp(-1.0))
    assert reward(3.46, 0.0) == pytest.approx(math.exp(-(3.46**2)), rel=1e-12)
    assert reward(3.47, 0.0) == reward(100.0, 0.0) == 0.0
