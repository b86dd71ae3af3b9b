"""Which parameters are off, where nothing else is: the fewest that explain the trials.

With all parameters free at once, one that is off hides behind others that do nearly the same, each
of them a little off. A lab seldom has all its numbers wrong. So parameters are put back to the
values that they were given, one after the other, the least missed first, as long as the odds that
it is off are less than `OFF_ODDS`. With a parameter's estimate z standard errors away from its
given value, and errors p assumed beforehand and e in the end,

    log odds = z^2 / 2 - log(p / e)

(Laplace; the second term is Occam's: a number of which one assumed that it may be off by a tenth is
not likely to be off by a thousandth). Sums over the readings are enough for it, taken where all
parameters are free; what is left is then refitted.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.covariance import clusters, covariance, widened
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import FreeParameters
from pma_gym.discovery.preparation.whitened_residuals import Pieces
from pma_gym.discovery.thresholds import OFF_ODDS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Elimination:
    """The fewest parameters that explain trials.

    Attributes:
        problem: on which they alone are free.
        fit: of them; the others are as they were given.
    """

    problem: FitProblem
    fit: Fitted


def backward_elimination(problem: FitProblem, fit: Fitted) -> Elimination | None:
    """The fewest parameters that explain the trials.

    Args:
        problem: the trials, with the noise that the fit leaves.
        fit: of all parameters, nothing added.
    Returns:
        They, or None where the sums are no numbers, or where chi-square grows by more than each
        parameter that was put back may cost, all together: a rig that is so far from the model is
        not to be judged by them.
    """
    whitened = problem.whitened_residuals(fit.model)
    pieces = whitened.pieces(fit.values, fit.steps, central=True)
    if pieces is None:
        return None
    kept = np.arange(len(fit.paths))
    moves, room = np.empty(0), 0.0
    while kept.size:
        moves, errors = _without_others(pieces, fit.values, whitened.centre, whitened.prior, kept)
        occam = np.log(np.maximum(whitened.prior[kept] / errors, 1.0))
        odds = 0.5 * (moves / errors) ** 2 - occam
        least = int(np.argmin(odds))
        if odds[least] > np.log(OFF_ODDS):
            break
        room += 2.0 * (np.log(OFF_ODDS) + occam[least])
        kept = np.delete(kept, least)
    most = fit.chi_square + room
    if not np.isfinite(most):
        return None
    paths = tuple(fit.paths[i] for i in kept)
    narrow = replace(problem, own=FreeParameters(paths, whitened.prior[kept]))
    if not paths:
        given = as_given(problem)
        return given if given.fit.chi_square <= most else None
    begun = np.clip(whitened.centre[kept] + moves, whitened.lower[kept], whitened.upper[kept])
    reduced = narrow.fit(problem.given.replace(dict(zip(paths, map(float, begun), strict=True))))
    if reduced is None or not reduced.chi_square <= most:
        return None
    return Elimination(narrow, replace(reduced, covariance=covariance(narrow, reduced, ())))


def as_given(problem: FitProblem) -> Elimination:
    """The model as it was given, with nothing free."""
    none = np.empty(0)
    narrow = replace(problem, own=FreeParameters((), none))
    left = narrow.whitened_residuals(problem.given).sums(none, none).chi_square
    return Elimination(
        narrow, Fitted(problem.given, (), (), none, np.empty((0, 0)), left, none, True)
    )


def _without_others(
    pieces: Pieces, values: Array, centre: Array, prior: Array, kept: NDArray[np.int64]
) -> tuple[Array, Array]:
    """How far some parameters move away from `centre` if all others stay there, and the errors."""
    curvatures = pieces.products[:, 1:, 1:]
    curvature = curvatures.sum(axis=0)
    back = centre - values
    gradient = pieces.products[:, 1:, 0].sum(axis=0) + curvature @ back
    own = np.ix_(kept, kept)
    inverse = np.linalg.inv(curvature[own] + np.diag(prior[kept] ** -2.0))
    moves = -inverse @ gradient[kept]
    away = back.copy()
    away[kept] += moves
    pulls = (pieces.products[:, 1:, 0] + curvatures @ away)[:, kept]
    return moves, np.sqrt(widened(np.diag(inverse), pulls, inverse, clusters(pieces)))
