"""Trials simulated all at once: each as if it were alone, also beside one that cannot be."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.discovery.experiments.predicted_trials import columns
from pma_gym.discovery.fitting.free_parameters import values
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import STATION, fit_problem, measured

TRIALS = measured(STATION, 2, rate=32.0, seconds=3.0, kinds=(0, 2), kpa=(200.0, 280.0))
PROBLEM = fit_problem(TRIALS)
FREE = PROBLEM.own.free
AT = values(STATION, FREE)
MOVED = np.stack([AT, 1.01 * AT, 0.99 * AT])
SOFTER = "stiffness.high_slope_n_per_mm_per_kpa"
"""Stiffness beyond 314 kPa, which the trials stay under."""


def columns_of(trials, tried=MOVED):
    return columns(PROBLEM, STATION, FREE, trials, tried)


def commanded(trial, kpa, volts, rows):
    """A trial with some of its commands replaced."""
    held = {
        "regulator_voltage": Plant(STATION).regulator_voltage(1e3 * kpa),
        "motor_voltage": volts,
    }
    commands = {name: row.copy() for name, row in trial.commands.items()}
    for name, value in held.items():
        commands[name][rows] = value
    return replace(trial, commands=commands)


def test_two_trials_together_are_as_each_alone_to_the_last_bit():
    together = columns_of(TRIALS)
    for ours, trial in zip(together, TRIALS, strict=True):
        (alone,) = columns_of([trial])
        assert ours.shape == (len(MOVED), 4, len(trial)) and ours[1:].any()
        np.testing.assert_array_equal(ours, alone)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_trial_that_begins_without_balance_spoils_no_other(place):
    """980 N on a muscle at 20 kPa, more than it holds."""
    hanging = commanded(TRIALS[0], 20.0, 10.0, slice(0, 1))
    together = columns_of([*TRIALS[:place], hanging, *TRIALS[place:]])
    assert together.pop(place) is None
    for ours, alone in zip(together, columns_of(TRIALS), strict=True):
        np.testing.assert_array_equal(ours, alone)


def test_a_trial_without_balance_at_one_of_the_parameters_spoils_no_other():
    """Beyond 314 kPa the softened muscle has no spring left; only the third trial begins there."""
    tried = np.stack([AT, AT])
    tried[1, FREE.index(SOFTER)] = -0.05
    *ours, none = columns_of([*TRIALS, commanded(TRIALS[0], 550.0, 1.0, slice(None))], tried)
    assert none is None
    for each, alone in zip(ours, columns_of(TRIALS, tried), strict=True):
        np.testing.assert_array_equal(each, alone)


def test_a_trial_that_runs_away_spoils_no_other():
    """Beyond 314 kPa the muscle pushes itself away; only the third trial goes there."""
    tried = np.stack([AT, AT])
    tried[1, FREE.index(SOFTER)] = -0.1
    running = commanded(TRIALS[1], 550.0, 1.0, slice(30, None))
    *ours, away = columns_of([*TRIALS, running], tried)
    assert away is None or np.abs(away[1]).max() > 1e6
    for each, alone in zip(ours, columns_of(TRIALS, tried), strict=True):
        np.testing.assert_array_equal(each, alone)


def test_no_trial_has_no_columns():
    assert columns_of([]) == []
