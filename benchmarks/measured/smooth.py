"""Error of a smooth function of the commands on left-out pressures.

It knows no physics and takes no more than smoothness: an error that a model should at least reach.
What it misses beyond the repeats may be rough in the commands (a ripple of the motor), change from
session to session, or lie too far between the pressures.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.measured.held_out import AT_LOAD, FIGURES, LOADED, rms
from pma_gym.data.datasets.dataset import Dataset
from pma_gym.data.trial import Trial
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

RESTARTS = 3
"""How often the search for lengths begins anew."""

LENGTHS: Any = np.array([1.0, 2.0])
"""Where the search for lengths begins (V of the regulator, V of the motor)."""

ROUGHEST = 0.05
"""Shortest length that is tried, in volts of either command."""


def smooth_errors(seen: Dataset, unseen: Dataset) -> dict[str, float]:
    """Rms at pressures that were not seen of a Gaussian process fitted to the others.

    Args:
        seen: trials of I3 that it is fitted to.
        unseen: trials of I3 that it is judged on.
    Returns:
        Rms errors in file units (mm, deg) by `FIGURES`, as functions of the two voltages; and
        `AT_LOAD`, the extension as a function of regulator voltage and measured load.
    """
    errors = {name: _error(seen, unseen, name, at_load=False) for name in FIGURES}
    return {**errors, AT_LOAD: _error(seen, unseen, "extension_mm", at_load=True)}


def _error(seen: Dataset, unseen: Dataset, figure: str, at_load: bool) -> float:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    known, values = _rows(seen, figure, at_load)
    asked, truth = _rows(unseen, figure, at_load)
    spread = float(values.std())
    kernel = ConstantKernel(spread**2, (1e-2 * spread**2, 1e3 * spread**2)) * RBF(
        LENGTHS, (ROUGHEST, 50.0)
    ) + WhiteKernel(0.01 * spread**2, (1e-6 * spread**2, spread**2))
    process = GaussianProcessRegressor(kernel, n_restarts_optimizer=RESTARTS, random_state=0)
    process.fit(known, values - values.mean())
    return rms(process.predict(asked) + values.mean() - truth)


def _rows(data: Dataset, figure: str, at_load: bool) -> tuple[Array, Array]:
    """What is known of each row, shape (rows, 2), and its figure in file units, shape (rows,)."""
    trials: Sequence[Trial] = [each.trial for each in data.trials if each.trial.measures("angle")]
    signal, plus, minus, unit = FIGURES[figure]
    read = np.array([each.measurements[signal] for each in trials])
    values = (read[:, plus] - read[:, minus]) / SI_FACTORS[unit]
    pulled = [
        # 100 N a volt, about: what matters is that a step means as much.
        each.measurements["load"][LOADED] / 100.0 if at_load else each.commands["motor_voltage"][1]
        for each in trials
    ]
    regulator = [each.commands["regulator_voltage"][0] for each in trials]
    known, there = np.column_stack([regulator, pulled]), np.isfinite(values)
    there &= np.isfinite(known).all(axis=1)
    return known[there], values[there]
