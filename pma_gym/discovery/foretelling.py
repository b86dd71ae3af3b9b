"""What a trial that nobody measured yet would tell: one of a protocol, simulated by a model.

What parameters could absorb of a change, given how well the trials so far determine them, is taken
out to first order.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.diagnosis import NextExperiment
from pma_gym.discovery.evidence import Evidence
from pma_gym.discovery.fits import Bench, Fitted
from pma_gym.discovery.protocols import Protocol
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

MOST = 50.0
"""Largest log odds that are promised: no model is that exact."""

LOOSE = 1e4
"""Standard deviation of a parameter that the trials do not determine, in steps of its
derivative."""


def left_over(differences: Array, derivatives: Array, fit: Fitted) -> Array:
    """Chi-square of differences that free parameters cannot absorb, given what is known of them.

    The minimum over moves m of |d + J m|^2 + m C^-1 m, with the covariance C of the fit.

    Args:
        differences: d, whitened, shape (k, n).
        derivatives: J, whitened, by the fit's parameters, shape (p, n).
        fit: says how well its parameters are known.
    Returns:
        Shape (k,).
    """
    moves = root(fit).T @ derivatives
    inner = moves @ moves.T + np.eye(len(moves))
    along = differences @ moves.T
    absorbed = np.sum(along * np.linalg.solve(inner, along.T).T, axis=1)
    return np.maximum(np.sum(differences**2, axis=1) - absorbed, 0.0)


def root(fit: Fitted) -> Array:
    """R with R R^T the covariance of a fit, shape (p, p)."""
    covariance = fit.covariance.copy()
    unknown = np.flatnonzero(~np.isfinite(np.diag(covariance)))
    covariance[unknown, unknown] = (LOOSE * fit.steps[unknown]) ** 2
    scale = np.sqrt(np.diag(covariance))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def derivatives(
    evidence: Evidence, fit: Fitted, which: Sequence[int] | NDArray[np.int64] | None = None
) -> Array | None:
    """Derivatives of one trial's whitened readings, shape (p, 4 rows); None if it has none.

    Args:
        evidence: the trial.
        fit: where, and how far parameters are moved for it.
        which: by which parameters; all if not given.
    """
    chosen = np.arange(len(fit.values)) if which is None else np.asarray(which)
    moved = fit.values + np.diag(fit.steps)[chosen]
    columns = evidence.columns(np.concatenate([fit.values[None], moved]))
    if columns is None:
        return None
    changes = columns[0][1:].astype(np.float64)
    return changes.reshape(len(chosen), -1) / fit.steps[chosen, None]


def foretold(bench: Bench, model: Model, free: Sequence[str], simulated: Trial) -> Evidence:
    """One simulated trial beside a model."""
    nothing = np.full(len(free), np.inf)
    trial = as_measured(bench, simulated)
    return Evidence(model, [trial], free, bench.noise, nothing, threads=bench.threads)


def as_measured(bench: Bench, simulated: Trial) -> Trial:
    """A simulated trial with the signals that the lab measures."""
    known = {name for trial in bench.trials for name in _measured(trial)}
    readings = {name: row for name, row in simulated.measurements.items() if name in known}
    return replace(simulated, measurements=readings, truth={})


def _measured(trial: Trial) -> Iterator[str]:
    for name, row in trial.measurements.items():
        if np.isfinite(row).any():
            yield name


def proposal(protocol: Protocol, separates: Sequence[str], log_odds: float) -> NextExperiment:
    """A protocol as an experiment to propose, with what it separates and by what odds."""
    odds = math.exp(min(log_odds, MOST))
    note = {"note": f"proposed: {protocol.name}"}
    trial = Trial(protocol.trial.time, protocol.trial.commands, provenance=note)
    return NextExperiment(protocol.name, tuple(separates), odds, protocol.minutes, trial)
