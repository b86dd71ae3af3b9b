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


def columns_of(trials):
    return columns(PROBLEM, STATION, FREE, trials, MOVED)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_trial_that_begins_without_balance_spoils_no_other(place):
    """980 N on a muscle at 20 kPa, more than it holds."""
    commands = {name: row.copy() for name, row in TRIALS[0].commands.items()}
    commands["regulator_voltage"][0] = Plant(STATION).regulator_voltage(20e3)
    commands["motor_voltage"][0] = 10.0
    hanging = replace(TRIALS[0], commands=commands)
    together = columns_of([*TRIALS[:place], hanging, *TRIALS[place:]])
    assert together.pop(place) is None
    for ours, alone in zip(together, columns_of(TRIALS), strict=True):
        np.testing.assert_array_equal(ours, alone)
