"""Small systems of normal equations: steps within bounds, covariances, and the result of a fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.plant.model import Model


@dataclass(frozen=True)
class Round:
    """Progress of a fit.

    Attributes:
        number: number of rounds so far.
        trials: number of trials in use.
        chi_square: smallest sum of squared residuals over these trials so far.
        values: its parameters by path, in file units.
    """

    number: int
    trials: int
    chi_square: float
    values: dict[str, float]


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        model: the model with the fitted parameters.
        parameters: the fitted parameters in SI, by `effect.parameter`.
        covariance: covariance of `parameters`, in their order, in SI, scaled as the errors, shape
            (p, p).
        values: the parameters in file units, by path, for `Model.replace`.
        errors: their standard errors, by path, from the measurement noise; scaled up if the
            residuals exceed the noise. Infinite for a parameter that the trials do not determine;
            nan for one at a bound.
        chi_square: sum of squared residuals, in standard deviations of the measurements.
        count: number of residuals.
        rounds: number of rounds, each with all finite differences.
        simulated: number of simulated trials.
        converged: whether the fit has converged, by `CLOSE`, `SHARE` or `RUGGED` of
            `pma_gym.estimation.fitting`.
        at_bounds: paths of parameters at a bound.
    """

    model: Model
    parameters: dict[str, float]
    covariance: NDArray[np.float64]
    values: dict[str, float]
    errors: dict[str, float]
    chi_square: float
    count: int
    rounds: int
    simulated: int
    converged: bool
    at_bounds: tuple[str, ...]

    @property
    def reduced_chi_square(self) -> float:
        """Chi-square per degree of freedom: 1 if the residuals are noise only."""
        return self.chi_square / max(self.count - len(self.values), 1)


Array = NDArray[np.float64]


def _eigen(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues, ascending, and eigenvectors of a symmetric matrix.

    Divide and conquer, LAPACK's fastest way, now and then gives up on a harmless matrix; its QR
    iteration takes over there.
    """
    try:
        return np.linalg.eigh(matrix)
    except np.linalg.LinAlgError:
        # Imported here as below.
        from scipy.linalg import eigh

        return eigh(matrix, driver="ev")


def least(gradient: Array, curvature: Array, damping: float, low: Array, high: Array) -> Array:
    """Minimise 2 g.x + x.(A + damping diag A) x within bounds around 0."""
    if not gradient.size:
        # A model without a parameter of its own: nothing moves.
        return gradient
    scale = np.sqrt(np.diag(curvature))
    scale = np.where(scale > 0.0, scale, 1.0)
    matrix = curvature / np.outer(scale, scale) + damping * np.eye(len(scale))
    values, vectors = _eigen(matrix)
    known = values > 1e-12 * values[-1]
    roots, across = np.sqrt(values[known]), vectors[:, known].T
    right = -(across @ (gradient / scale)) / roots
    step = across.T @ (right / roots) / scale
    if np.all((low <= step) & (step <= high)):
        return step
    # Imported here: it takes half as long as all else of this package together.
    from scipy.optimize import lsq_linear

    bounds = np.minimum(low * scale, -1e-300), np.maximum(high * scale, 1e-300)
    solution = lsq_linear(roots[:, None] * across, right, bounds, method="bvls", tol=1e-12)
    return np.clip(solution.x / scale, low, high)


def inverse(curvature: Array) -> Array:
    """Invert the matrix; the diagonal is infinite for parameters that are not identifiable."""
    scale = np.sqrt(np.diag(curvature))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = _eigen(curvature / np.outer(scale, scale))
    known = values > 1e-10 * np.max(values, initial=0.0)
    inverted = (vectors[:, known] / values[known]) @ vectors[:, known].T / np.outer(scale, scale)
    is_undetermined = np.any(np.abs(vectors[:, ~known]) > 1e-3, axis=1)
    np.fill_diagonal(inverted, np.where(is_undetermined, np.inf, np.diag(inverted)))
    return inverted
