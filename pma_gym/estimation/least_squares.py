"""Small systems of normal equations: steps within bounds and covariances."""

import numpy as np
from numpy.typing import NDArray

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
