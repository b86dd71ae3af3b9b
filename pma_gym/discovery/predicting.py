"""What fits say of trials that they have not seen, and how sure they are of it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.evidence import Evidence
from pma_gym.discovery.fits import Fitted

Array = NDArray[np.float64]

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


def surprise(seen: Evidence, every: Evidence, apart: Fitted, together: Fitted) -> float:
    """How little some trials expect others: twice the negative log-likelihood, but for a constant.

    p(others | seen) = p(both) / p(seen), each by Laplace about what fits both: what chi-square
    grows by when the others are fitted too, and what freedom they take from the parameters,

        chi2(both) - chi2(seen) + log det(H_both) - log det(H_seen)

    A parameter that the seen trials hardly hold costs its freedom, within its bounds, and not the
    errors of the chance value that they would give it. Where they hold all of them well this is
    the chi-square of the others.

    Args:
        seen: the seen trials.
        every: all of them.
        apart: the fit of the seen ones.
        together: the fit of all.
    """
    widths = seen.upper - seen.lower
    logs = []
    for evidence in (every, seen):
        curvature = evidence.sums(together.values, together.steps).curvature
        scaled = curvature * np.outer(widths, widths) + np.eye(len(widths))
        logs.append(np.linalg.slogdet(scaled)[1])
    return float(together.chi_square - apart.chi_square + logs[0] - logs[1])
