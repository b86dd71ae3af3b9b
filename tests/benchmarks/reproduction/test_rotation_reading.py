"""The declared reading of the rotation trials: what it reads, and how far it takes table 30."""

import numpy as np
import pytest

from benchmarks.reproduction.rotation_reading import (
    CALIBRATED_DEG_PER_V,
    DECODED_DEG_PER_V,
    DEG,
    GAP_DEG,
    declared,
    mean_absolute_error,
    read_trials,
)
from pma_gym.data.calibration import POTENTIOMETER
from pma_gym.plant.plant import Plant
from pma_gym.units import SI_FACTORS


@pytest.fixture(scope="module")
def plant():
    return Plant("station")


def test_a_gap_reads_nothing_and_then_what_is_decoded(plant):
    radius, reading = plant.model.parameters["rotor"].radius, declared(plant)
    slack = reading.slack / radius
    angles = np.array([0.0, slack + 19.9 * DEG, slack + 20.1 * DEG, slack + 99.0 * DEG])
    read = reading.of(angles, radius) / DEG
    assert read == pytest.approx([0.0, 0.0, 20.1 * 64 / 70.4, 90.0])


def test_its_numbers_are_those_of_their_sources():
    assert DECODED_DEG_PER_V == 320.0 / 5.0 and GAP_DEG == 360.0 - 340.0
    per_volt = (POTENTIOMETER.from_volts(1.0) - POTENTIOMETER.from_volts(0.0)) / SI_FACTORS["deg"]
    assert CALIBRATED_DEG_PER_V == pytest.approx(per_volt, abs=0.03)


def test_it_explains_most_of_table_30_and_never_touches_the_plant(plant):
    before = plant.model
    trials = read_trials(plant)
    assert len(trials) == 8
    # Frozen: no number of the reading or of the plant was fitted to it.
    assert mean_absolute_error(trials, read=False) == pytest.approx(7.67, abs=0.05)
    assert mean_absolute_error(trials, read=True) == pytest.approx(1.28, abs=0.05)
    assert Plant("station").model == before
