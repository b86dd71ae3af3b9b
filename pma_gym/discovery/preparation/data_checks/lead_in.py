"""A lead-in for records of an imposed motion that begin while it moves.

The motion is known from the first row, but what rubs has been deflected before. A second of the
same motion, with nothing measured, goes before such a record.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.thresholds import WORTH_A_LEAD_IN
from pma_gym.plant.model import Model

LEAD_S = 1.0
"""Duration of a lead-in (s)."""

FIRST_ROWS = 8
"""Least number of first rows that the velocity is taken from."""


def with_lead_in(named: NamedTrial, model: Model) -> NamedTrial:
    """A record of an imposed motion, with a lead-in where it begins in motion.

    Args:
        named: the record.
        model: says which command is the motion, and how smooth it is.
    """
    (command,) = model.rig.direct_commands.values()
    trial = named.trial
    positions = trial.commands.get(command)
    if positions is None or len(trial.time) < FIRST_ROWS or np.isnan(positions).any():
        return named
    begin, rate = _beginning(trial.time, positions, model.parameters["imposed_motion"].bandwidth)
    if abs(rate) * LEAD_S < WORTH_A_LEAD_IN * float(np.ptp(positions)):
        return named
    step = float(np.median(np.diff(trial.time)))
    before = trial.time[0] - step * np.arange(max(1, round(LEAD_S / step)), 0, -1)
    commands = {name: _held(values, len(before)) for name, values in trial.commands.items()}
    commands[command][: len(before)] = begin + rate * (before - trial.time[0])
    nothing = np.full(len(before), np.nan)
    led = Trial(
        np.concatenate([before, trial.time]),
        commands,
        {name: np.concatenate([nothing, values]) for name, values in trial.measurements.items()},
        provenance=trial.provenance,
        memory_at_start=trial.memory_at_start,
    )
    return replace(named, trial=led)


def _beginning(
    time: NDArray[np.float64], positions: NDArray[np.float64], bandwidth: float
) -> tuple[float, float]:
    """Position and velocity where a record begins: of a parabola through its first rows."""
    count = max(FIRST_ROWS, int(np.searchsorted(time - time[0], 1.0 / bandwidth)))
    fitted = np.polynomial.Polynomial.fit(time[:count] - time[0], positions[:count], 2)
    return float(fitted(0.0)), float(fitted.deriv()(0.0))


def _held(values: NDArray[np.float64], rows: int) -> NDArray[np.float64]:
    """A command with its first value in rows before."""
    return np.concatenate([np.full(rows, values[0]), values])
