"""A Gaussian process on the residual: it sees that something is missing, and cannot say what.

Of each trial, left out once, it foretells the refitted model's residual from where the rig is and
how it moves. What it explains of a signal there is the alarm.
"""

# pyright: reportMissingImports=false
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.hidden_effects.baselines.preparation import answer, moved, prepare
from benchmarks.hidden_effects.baselines.signatures import courses, means, time_bins, within
from pma_gym.data.datasets.dataset import Dataset
from pma_gym.plant.rigs import RIGS

Array = NDArray[np.float64]

CONDITIONS = (
    "contraction",
    "speed",
    "direction",
    "load",
    "load rate",
    "pressure rate",
    "fading",
    "creep 2 s",
)
"""What the residual may depend on; names of `signatures.courses`."""

MOST_BINS = 200
"""Ticks that a process learns from, evenly out of all: its cost grows with the cube."""

EXPLAINED = 0.05
"""Share of a signal's variance that must be foretold in trials left out for an alarm."""


def gaussian_process(dataset: Dataset, seed: int, jobs: int) -> Mapping[str, Any]:
    """`unknown` where a signal's residual can be foretold."""
    ready = prepare(dataset, jobs)
    some = time_bins(ready)
    along = courses(some)
    conditions = np.stack([along[name] for name in CONDITIONS] + [some.pressure], axis=1)
    spread = conditions.std(axis=0)
    conditions = (conditions - conditions.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    left = within(some, means(some))
    shares = {
        name: explained(conditions, left[channel], some.order, seed)
        for channel, name in enumerate(RIGS["station"].outputs)
    }
    parameters = moved(ready.problem, ready.refitted)
    if max(shares.values()) > EXPLAINED:
        return answer("unknown", (), parameters, explained=shares)
    return answer("parameters" if ready.moved else "agrees", (), parameters, explained=shares)


def explained(conditions: Array, left: Array, trial: Array, seed: int) -> float:
    """Share of the variance of `left` that is foretold where it was not seen; negative if worse.

    Args:
        conditions: scaled, shape (n, k).
        left: a residual, shape (n,).
        trial: which trial each is of, shape (n,); each is left out once.
        seed: of the search for the kernel.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    scale = float(np.sqrt(np.mean(left**2)))
    if scale == 0.0:
        return 0.0
    every = left / scale
    few = np.linspace(0, len(left) - 1, min(MOST_BINS, len(left))).astype(int)
    width = 2.0 * np.ones(conditions.shape[1])
    # Scikit-learn takes a width a column and no optimizer, as it says, but not as its types do.
    smooth = RBF(width, (0.2, 1e2))  # type: ignore[arg-type]
    kernel = ConstantKernel(0.3, (1e-3, 1e2)) * smooth + WhiteKernel(0.7)
    process = GaussianProcessRegressor(kernel, random_state=seed)
    with warnings.catch_warnings():
        # A condition that does not matter has a width at its bound.
        warnings.simplefilter("ignore", ConvergenceWarning)
        learnt = process.fit(conditions[few], every[few]).kernel_
    missed = np.empty_like(every)
    for one in np.unique(trial):
        out = trial == one
        seen = few[~out[few]]
        fixed = GaussianProcessRegressor(learnt, optimizer=None)  # type: ignore[arg-type]
        missed[out] = every[out] - fixed.fit(conditions[seen], every[seen]).predict(conditions[out])
    return float(1.0 - np.mean(missed**2))
