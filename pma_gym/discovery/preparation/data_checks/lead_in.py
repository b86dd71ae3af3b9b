"""A lead-in for records of an imposed motion that begin while it moves.

The motion is known from the first row, but what rubs has been deflected before. A second of the
same motion, with nothing measured, goes before such a record.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.plant.imposed_motion import smoothed
from pma_gym.plant.model import Model

LEAD_S = 1.0
"""Duration of a lead-in (s)."""

MOVING = 0.02
"""Share of a record's stroke that a lead-in must cover to be worth its rows."""


def with_lead_in(named: NamedTrial, model: Model) -> NamedTrial:
    """A record of an imposed motion, with a lead-in where it begins in motion.

    Args:
        named: the record.
        model: says which command is the motion, and how smooth it is.
    """
    (command,) = model.rig.direct_commands.values()
    trial = named.trial
    positions = trial.commands.get(command)
    if positions is None or len(trial.time) < 3 or np.isnan(positions).any():
        return named
    bandwidth = model.parameters["imposed_motion"].bandwidth
    motion, rate, _ = smoothed(trial.time, positions, bandwidth)
    if abs(rate[0]) * LEAD_S < MOVING * float(np.ptp(motion)):
        return named
    step = float(np.median(np.diff(trial.time)))
    before = trial.time[0] - step * np.arange(max(1, round(LEAD_S / step)), 0, -1)
    commands = {name: _held(values, len(before)) for name, values in trial.commands.items()}
    commands[command][: len(before)] = motion[0] + rate[0] * (before - trial.time[0])
    nothing = np.full(len(before), np.nan)
    led = Trial(
        np.concatenate([before, trial.time]),
        commands,
        {name: np.concatenate([nothing, values]) for name, values in trial.measurements.items()},
        provenance=trial.provenance,
        memory_at_start=trial.memory_at_start,
    )
    return replace(named, trial=led)


def _held(values: NDArray[np.float64], rows: int) -> NDArray[np.float64]:
    """A command with its first value in rows before."""
    return np.concatenate([np.full(rows, values[0]), values])
