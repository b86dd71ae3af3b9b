"""What fits say of trials that they have not seen, and how sure they are of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.thresholds import PRIOR_SIZE

Array = NDArray[np.float64]

LOOSE = 1e4
"""Standard deviation of a parameter that the trials do not determine, in steps of its
derivative."""


def unabsorbed(differences: Array, by: Array, fit: Fitted) -> Array:
    """Chi-square of differences that free parameters cannot absorb, given what is known of them.

    The minimum over moves m of |d + J m|^2 + m C^-1 m, with the covariance C of the fit.

    Args:
        differences: d, whitened, shape (k, n).
        by: J, derivatives, whitened, by the fit's parameters, shape (p, n).
        fit: says how well its parameters are known.
    Returns:
        Shape (k,).
    """
    moves = covariance_root(fit).T @ by
    inner = moves @ moves.T + np.eye(len(moves))
    along = differences @ moves.T
    absorbed = np.sum(along * np.linalg.solve(inner, along.T).T, axis=1)
    return np.maximum(np.sum(differences**2, axis=1) - absorbed, 0.0)


def covariance_root(fit: Fitted) -> Array:
    """R with R R^T the covariance of a fit, shape (p, p)."""
    covariance = fit.covariance.copy()
    unknown = np.flatnonzero(~np.isfinite(np.diag(covariance)))
    covariance[unknown, unknown] = (LOOSE * fit.steps[unknown]) ** 2
    scale = np.sqrt(np.diag(covariance))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


@dataclass(frozen=True)
class PredictiveDensity:
    """The fit of all trials, which parts of them are set against.

    Attributes:
        fit: with the noise that the bench has now.
        freedom: log determinant of what all trials and the prior tell of its parameters.
    """

    fit: Fitted
    freedom: float

    @classmethod
    def of(
        cls, problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect]
    ) -> "PredictiveDensity":
        """Of a model with candidates in it, from where a fit is."""
        refit = (problem.fit(fit.model, chosen) if fit.paths else None) or fit
        whitened = problem.whitened_residuals(refit.model, chosen)
        if not refit.paths:
            refit = replace(refit, chi_square=_chi_square(whitened, refit))
        return cls(refit, freedom(whitened, refit))

    def deviance(self, seen: WhitenedResiduals, apart: Fitted) -> float:
        """How little some trials expect the others: twice the negative log-likelihood.

        p(others | seen) = p(all) / p(seen), each by Laplace, the determinants at what fits all: by
        how much chi-square grows when the others are fitted too, and what freedom they take,

            chi2(all) - chi2(seen) + log det H(all) - log det H(seen)

        A parameter that the seen trials hardly hold costs its freedom, and not the errors of the
        chance value that they would give it. Where they hold all of them well this is the
        chi-square of the others. No unit, but for a constant that is the same for all models with
        the same noise; infinite where a trial cannot be simulated.

        Args:
            seen: the seen trials, beside the model that was fitted to all.
            apart: the fit of them alone.
        """
        alone = apart.chi_square if apart.paths else _chi_square(seen, apart)
        increase = self.fit.chi_square - alone + self.freedom - freedom(seen, self.fit)
        return increase if np.isfinite(increase) else np.inf


def freedom(whitened: WhitenedResiduals, fit: Fitted) -> float:
    """Log determinant of the curvature at a fit, in units of what a parameter might have been.

    That is as far as its bounds reach, and `PRIOR_SIZE` times its value at most.
    """
    size = np.where(fit.values == 0.0, np.inf, PRIOR_SIZE * np.abs(fit.values))
    widths = np.minimum(whitened.upper - whitened.lower, size)
    curvature = whitened.sums(fit.values, fit.steps).curvature
    if not np.isfinite(curvature).all():
        return np.nan
    return float(np.linalg.slogdet(curvature * np.outer(widths, widths) + np.eye(len(widths)))[1])


def _chi_square(whitened: WhitenedResiduals, fit: Fitted) -> float:
    return whitened.sums(fit.values, np.empty(0)).chi_square
