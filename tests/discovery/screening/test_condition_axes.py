"""Regions and maps speak of the conditions that a rig has, in its units."""

import pytest

from pma_gym.discovery.screening.condition_axes import condition_axes
from pma_gym.plant.rigs import RIGS

SPOKEN = {
    "station": ("pressure kPa, load N, contraction mm", "mm/s", "shortening"),
    "slide": ("contraction mm", "mm/s", "shortening"),
    "joint": ("angle deg", "deg/s", "turning forwards"),
}


@pytest.mark.parametrize("name", SPOKEN)
def test_conditions_have_the_words_of_the_rigs_signals(name):
    levels, unit, forwards = SPOKEN[name]
    axes = condition_axes(RIGS[name].signals)
    assert ", ".join(f"{axis.words} {axis.unit}" for axis in axes.levels) == levels
    assert (axes.speed.unit, axes.forwards) == (unit, forwards)
