"""Commanded and measured pressures that are both in another unit: they agree with each other.

Two things show it. Commands in another unit lie outside the model's `[validity]`, and inside once
they are corrected; absolute pressures lie inside as they are. And only what pressure does bears it
out: corrected, the model must come several times closer to the measured motion, and closer than
with any other unit or shift.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.data_checks.simulated import Pair, pairs
from pma_gym.discovery.preparation.data_checks.units import ABSOLUTE, PRESSURE_UNITS, Unit
from pma_gym.discovery.thresholds import (
    BEYOND,
    CLOSER,
    CLOSER_OUTSIDE,
    LEAST_ABSOLUTE_PA,
    UNDOUBTED_M,
)
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

OTHER_SHIFTS = (160e3, 130e3, 70e3, 40e3, 0.0, -40e3)
"""Offsets of commanded pressures that absolute pressures are compared with (Pa)."""

_JUDGES = {"contraction": 1.0, "rotation": 0.025}
"""Motions that pressure shows in, with the metres of contraction that one unit (SI) of each is."""


@dataclass(frozen=True)
class Level:
    """Commanded pressures in another unit, and the measured ones with them.

    Attributes:
        unit: of both.
        commanded: lowest and highest command, as they are read (Pa).
        valid: range of pressures in which the model holds (Pa).
        given: rms misfit of the motion as read (m); infinite where the model cannot follow.
        corrected: the same with the pressures corrected.
    """

    unit: Unit
    commanded: tuple[float, float]
    valid: tuple[float, float]
    given: float
    corrected: float


def pressure_level(model: Model, trials: Sequence[Trial]) -> Level | None:
    """The unit of commanded pressures although measured ones, if any, agree with them.

    Returns:
        None where nothing speaks for another unit.
    """
    motion = next((m for m in _JUDGES if all(_shows(trial, m) for trial in trials)), None)
    validity = model.parameters.get("validity")
    if motion is None or validity is None:
        return None
    commands = np.concatenate([trial.commands["pressure_command"] for trial in trials])
    low, high = float(np.nanmin(commands)), float(np.nanmax(commands))
    units = [unit for unit in PRESSURE_UNITS if unit.factor > 0.0 and unit.factor != 1.0]
    inside = (validity.lowest, BEYOND * validity.highest)
    is_outside = high < inside[0] or inside[1] < low
    if not is_outside:
        units = [ABSOLUTE] if low >= LEAST_ABSOLUTE_PA else []
    units = [unit for unit in units if inside[0] <= unit.corrected(np.array(high)) <= inside[1]]
    if not units:
        return None
    others = [Unit(1.0, "", offset) for offset in ((0.0,) if is_outside else OTHER_SHIFTS)]
    misfits = {
        unit: _JUDGES[motion] * _misfit(pairs(model, trials, unit.corrected), len(trials), motion)
        for unit in (*units, *others)
    }
    best = min(misfits, key=lambda unit: misfits[unit])
    given = misfits[Unit(1.0, "")]
    most = (CLOSER_OUTSIDE if is_outside else CLOSER) * given
    if best not in units or given < UNDOUBTED_M or misfits[best] > most:
        return None
    valid = (validity.lowest, validity.highest)
    return Level(best, (low, high), valid, given, misfits[best])


def _shows(trial: Trial, motion: str) -> bool:
    """Whether a trial commands a pressure in its own unit, and measures a motion."""
    command, moved = SIGNALS["pressure_command"], trial.measurements.get(motion)
    if command.name not in trial.commands or command.voltage in trial.commands:
        return False
    return moved is not None and bool(np.isfinite(moved).any())


def _misfit(pairs: Sequence[Pair], wanted: int, motion: str) -> float:
    """Rms of measured less simulated motion (SI), one zero for all trials."""
    if len(pairs) < wanted:
        return np.inf
    away = [measured - simulated for _, simulated, measured in (p.signal(motion) for p in pairs)]
    joined = np.concatenate([each[:: max(1, each.size // 500)] for each in away])
    # A lab's zero of contraction is its own: one number for all trials.
    return float(np.sqrt(np.mean((joined - np.median(joined)) ** 2)))
