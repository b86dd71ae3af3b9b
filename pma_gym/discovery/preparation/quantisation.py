"""Sensors whose readings keep to coarser steps than their DAQ gives: seen in the readings alone."""

from collections.abc import Sequence

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.diagnosis import Estimate, NamedEffect
from pma_gym.discovery.preparation.initial_floors import Level
from pma_gym.units import SI_FACTORS

COARSER = 1.5
"""How many of the DAQ's steps make a step coarse."""

NAME = "sensor_quantisation"
MISS = 0.05
"""Share of a step that a reading may miss a whole one by; over all steps between the least and the
largest reading, of which there are at least as many as differ, that is what the step may be off."""

HIDDEN = 1.0
"""Noise hides a step if its standard deviation, rounding included, is this many steps or more: what
rounding adds to such readings is noise like any other."""

CHANCE = 0.1
"""Of a reading that lies within a twentieth of a step from a whole one by chance. Two readings make
the step; every other that differs from them has to keep to it."""


def is_coarse(floor: Level) -> bool:
    """Whether a signal's readings keep to steps that neither the DAQ nor noise explains."""
    return floor.step > max(COARSER * floor.expected_step, floor.level / HIDDEN)


def coarse_sensors(
    floors: Sequence[Level], misfits: Sequence[float] | None = None
) -> tuple[NamedEffect, ...]:
    """One effect with the steps of all coarse sensors; none where there are none.

    Args:
        floors: noise of the signals.
        misfits: what the refitted model leaves of them (root mean square, SI), NaN where nothing
            is measured. Rounding makes no misfit of more than a step, so a sensor with more is not
            named: that would explain the misfit by what is too small for it.
    """
    steps, others = {}, 0
    for channel, floor in enumerate(floors):
        explains = misfits is None or not misfits[channel] > floor.step
        if is_coarse(floor) and explains:
            column = BY_QUANTITY[floor.signal.name]
            others += max(0, floor.distinct - 2)
            size = floor.step / SI_FACTORS[column.unit]
            sure = MISS * size / max(floor.distinct - 1, 1)
            steps[f"{column.name}_step"] = Estimate(size, size - sure, size + sure, column.unit)
    return (NamedEffect(NAME, (), max(CHANCE**others, 1e-300), steps),) if steps else ()
