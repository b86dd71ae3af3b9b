"""Commanded and measured pressures that both are absolute: they agree, and the model is misled.

Only what pressure does shows it: with the air's pressure taken off the commands, the model must
come several times closer to the measured motion, and closer than with any other shift.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.data_checks.simulated import ATMOSPHERE, Pair, pairs
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

LEAST = 80e3
"""Least commanded pressure (Pa): the air's, on a mountain; less is no absolute pressure."""

SHIFTS = (-160e3, -130e3, -ATMOSPHERE, -70e3, -40e3, 0.0, 40e3)
"""Shifts of commanded pressures that are compared (Pa)."""

CLOSER = 0.4
"""Largest share of the misfit that is left once the air's pressure is taken off."""

_NEEDED = 1e-3
"""Rms misfit of contraction (m) below which the commands are not doubted."""


def both_absolute(model: Model, trials: Sequence[Trial]) -> tuple[float, float] | None:
    """Whether commanded pressures are absolute although measured ones, if any, agree with them.

    Returns:
        Rms misfit of contraction (m) as commanded, infinite where the model cannot follow, and
        with the air's pressure taken off; None where nothing speaks for absolute pressures.
    """
    chosen = [trial for trial in trials if _may_be(trial)]
    if not chosen or len(chosen) < len(trials):
        return None
    misfits = {shift: _misfit(pairs(model, chosen, shift), len(chosen)) for shift in SHIFTS}
    best = min(misfits, key=lambda shift: misfits[shift])
    given, off = misfits[0.0], misfits[-ATMOSPHERE]
    if best != -ATMOSPHERE or given < _NEEDED or off > CLOSER * given:
        return None
    return given, off


def _may_be(trial: Trial) -> bool:
    command = SIGNALS["pressure_command"]
    wished = trial.commands.get(command.name)
    contraction = trial.measurements.get("contraction")
    if wished is None or contraction is None or command.voltage in trial.commands:
        return False
    return float(np.nanmin(wished)) >= LEAST and bool(np.isfinite(contraction).any())


def _misfit(pairs: Sequence[Pair], wanted: int) -> float:
    """Rms of measured less simulated contraction (m), one zero for all trials."""
    if len(pairs) < wanted:
        return np.inf
    away = [
        measured - simulated for _, simulated, measured in (p.signal("contraction") for p in pairs)
    ]
    joined = np.concatenate([each[:: max(1, each.size // 500)] for each in away])
    # A lab's zero of contraction is its own: one number for all trials.
    return float(np.sqrt(np.mean((joined - np.median(joined)) ** 2)))
