"""Sensors whose readings keep to coarse steps: seen in the readings alone."""

from collections.abc import Sequence

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.preparation.initial_floors import Level
from pma_gym.discovery.result.estimates import Estimate, NamedEffect
from pma_gym.discovery.thresholds import COARSER, DITHER, HIDDEN, MISS, STEP_CHANCE
from pma_gym.units import SI_FACTORS

NAME = "sensor_quantisation"


def is_coarse(floor: Level) -> bool:
    """Whether a signal's readings keep to steps that noise does not blur.

    Where the step is known that the sensor should have, only to coarser ones than that.
    """
    if floor.expected_step > 0.0:
        return is_coarser(floor)
    before = max(floor.level**2 - floor.step**2 / 12.0, 0.0)
    return before < (DITHER * floor.step) ** 2


def is_coarser(floor: Level) -> bool:
    """Whether a signal's readings keep to steps that neither its sensor nor noise explains.

    What no lab, and no DAQ, states is learnt from the readings: no step is too coarse for it.
    """
    known = floor.expected_step > 0.0
    return known and floor.step > max(COARSER * floor.expected_step, floor.level / HIDDEN)


def coarse_sensors(
    floors: Sequence[Level], misfits: Sequence[float] | None = None
) -> tuple[NamedEffect, ...]:
    """One effect with the steps of all sensors that are coarser than they should be, if any is.

    Args:
        floors: noise of the signals.
        misfits: what the refitted model leaves of them (root mean square, SI), NaN where nothing
            is measured. Rounding makes no misfit of more than a step, so a sensor with more is not
            named: that would explain the misfit by what is too small for it.
    """
    steps, others = {}, 0
    for channel, floor in enumerate(floors):
        explains = misfits is None or not misfits[channel] > floor.step
        if is_coarser(floor) and explains:
            column = BY_QUANTITY[floor.signal.name]
            others += max(0, floor.distinct - 2)
            size = floor.step / SI_FACTORS[column.unit]
            sure = MISS * size / max(floor.distinct - 1, 1)
            steps[f"{column.name}_step"] = Estimate(size, size - sure, size + sure, column.unit)
    return (NamedEffect(NAME, (), max(STEP_CHANCE**others, 1e-300), steps),) if steps else ()
