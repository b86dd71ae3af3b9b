"""Diagnoses of logs whose readings are wrong: the rigs of another simulator have what is known."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pma_gym.discovery import diagnose
from tests.discovery.grey_box import test_free_rigs as rigs

NOISE = {"slide": 2e-5, "joint": 4e-4}
READING = {"slide": "contraction", "joint": "angle"}


@cache
def moved(plant):
    """Trials of a rig without dry friction, whose readings have no noise."""
    kept = rigs.RIGS[plant]
    try:
        rigs.RIGS[plant] = (*kept[:2], 0.0, *kept[3:5], 0.0, *kept[6:])
        return rigs.logs(plant)
    finally:
        rigs.RIGS[plant] = kept


def diagnosed(plant, wrong):
    """The diagnosis where `wrong(time, position)` is read, with noise."""
    generator, trials = np.random.default_rng(7), []
    for trial in moved(plant):
        read = wrong(trial.time, trial.measurements[READING[plant]])
        read = read + NOISE[plant] * generator.standard_normal(len(read))
        trials.append(replace(trial, measurements={READING[plant]: read}))
    return diagnose(trials, rigs.model(plant), propose=False)


def holds(estimate, truth):
    """Whether the truth is in an interval."""
    return estimate.low <= truth <= estimate.high


@pytest.mark.campaign
def test_a_bent_sensor_is_named_with_its_curvature():
    diagnosis = diagnosed("slide", lambda _, q: q + 0.1 * q**2)
    sizes = {effect.name: effect.parameters for effect in diagnosis.effects}
    assert holds(sizes["lvdt_bend"]["curvature_percent_per_mm"], 0.01), diagnosis.sentence
