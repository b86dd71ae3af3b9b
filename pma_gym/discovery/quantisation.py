"""Sensors whose readings keep to coarser steps than their DAQ gives: seen in the readings alone."""

from collections.abc import Sequence

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.diagnosis import Estimate, NamedEffect
from pma_gym.discovery.floors import Level
from pma_gym.plant.plant import OUTPUTS
from pma_gym.units import SI_FACTORS

COARSER = 1.5
"""How many of the DAQ's steps make a step coarse."""

NAME = "sensor_quantisation"
P_VALUE = 1e-6
"""Of readings that all keep to coarse steps by chance, at most: each of four or more distinct ones
lies within a twentieth of a step, one chance in ten, and some dozen are distinct in any trial."""


def coarse_sensors(floors: Sequence[Level]) -> tuple[NamedEffect, ...]:
    """One effect with the steps of all coarse sensors; none where there are none."""
    steps = {}
    for name, floor in zip(OUTPUTS, floors, strict=True):
        if floor.step > COARSER * floor.expected_step:
            column = BY_QUANTITY[name]
            size = floor.step / SI_FACTORS[column.unit]
            steps[f"{column.name}_step"] = Estimate(size, size, size, column.unit)
    return (NamedEffect(NAME, (), P_VALUE, steps),) if steps else ()
