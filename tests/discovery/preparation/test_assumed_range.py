"""Ranges assumed beforehand: widened while a fit gains by it, never beyond what is possible."""

from functools import cache

import numpy as np
import pytest

from pma_gym.discovery.preparation.assumed_range import (
    FARTHEST,
    MOST_DOUBLINGS,
    assumed_range,
    needed_reach,
)
from pma_gym.discovery.workflow import refit
from tests.discovery.laboratory import STATION, fit_problem, measured

GAIN = "drive.gain_n_per_v"


@cache
def strong_drive(factor):
    """Trials of a station whose drive is so many times as strong as its model says."""
    gain = factor * STATION.values_in_files("drive")["gain_n_per_v"]
    kinds = {"kinds": (0, 0), "kpa": (400.0, 520.0)}
    return measured(STATION.replace({GAIN: gain}), 2, rate=32.0, **kinds), gain


def test_a_range_reaches_six_standard_deviations_and_stays_within_the_possible():
    centre, prior = np.array([100.0, 0.5, 3.0]), np.array([10.0, 1.0, np.inf])
    lower, upper = np.array([0.0, -20.0, 0.0]), np.array([1000.0, 20.0, 200.0])
    low, high = assumed_range(centre, prior, lower, upper, np.ones(3))
    np.testing.assert_allclose(low, [100.0 - 10.0 * FARTHEST, 0.5 - FARTHEST, 0.0])
    np.testing.assert_allclose(high, [160.0, 6.5, 200.0])
    low, high = assumed_range(centre, prior, lower, upper, np.full(3, 2.0**MOST_DOUBLINGS))
    # A positive number comes nearer to 0 by halves; another ends where the catalogue ends.
    np.testing.assert_allclose(low, [40.0 / 32.0, -20.0, 0.0])
    np.testing.assert_allclose(high, [1000.0, 20.0, 200.0])


def test_what_lies_beyond_needs_as_many_doublings_as_hold_it():
    centre, prior = np.array([100.0, 100.0, 100.0]), np.full(3, 10.0)
    lower, upper = np.zeros(3), np.full(3, 1000.0)
    reach = needed_reach(np.array([150.0, 190.0, 15.0]), centre, prior, lower, upper)
    np.testing.assert_array_equal(reach, [1.0, 2.0, 4.0])


def test_a_fit_goes_beyond_what_was_assumed_where_the_trials_ask_for_it():
    trials, gain = strong_drive(2.0)
    shared = fit_problem(trials)
    fitted = shared.fit(STATION)
    assert fitted is not None
    assert fitted.estimate(GAIN)[0] == pytest.approx(gain, rel=0.01)
    assert fitted.reach[GAIN] == 2.0
    assert not shared.whitened_at(fitted).at_assumed_edge(fitted.values)


def test_a_fit_from_beyond_stays_there():
    trials, _ = strong_drive(2.0)
    first = fit_problem(trials).fit(STATION)
    assert first is not None
    again = fit_problem(trials).fit(first.model, trials=[0])
    assert again is not None and again.reach == first.reach
    assert again.estimate(GAIN)[0] == pytest.approx(first.estimate(GAIN)[0], rel=0.02)


def test_the_reader_is_told_what_went_beyond():
    trials, _ = strong_drive(2.0)
    diagnosis = refit(trials, STATION)
    (said,) = (words for words in diagnosis.warnings if words.startswith(GAIN))
    assert "beyond what is assumed beforehand (39.1 to 157 N/V)" in said
    assert "widened 2 times" in said
