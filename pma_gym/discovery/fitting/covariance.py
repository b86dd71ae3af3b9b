"""Standard errors that a model a little wrong does not make too small.

The curvature of chi-square alone says how sure parameters are if nothing is left but noise. What is
left of a real rig is slow too, and pulls at parameters for seconds together. So the pull of
stretches of time is looked at, of a second, of ever twice as long and of whole trials (the sandwich
of Huber and White, by clusters), and the largest error of all counts.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.preparation.whitened_residuals import Pieces
from pma_gym.discovery.thresholds import BLOCK_S, INDEPENDENT_S, LEAST_STRETCHES, LEAST_TRIALS

Array = NDArray[np.float64]


def covariance(problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect]) -> Array:
    """Covariance of a fit's parameters, shape (p, p), in file units.

    Correlations are those of the curvature; errors are the largest that it, stretches or trials
    give.
    """
    whitened = problem.whitened_residuals(fit.model, chosen)
    pieces = whitened.pieces(fit.values, fit.steps)
    if pieces is None:
        return fit.covariance
    known = np.isfinite(np.diag(fit.covariance))
    pulls = pieces.products[:, 1:, 0][:, known]
    inverse = fit.covariance[np.ix_(known, known)]
    squares = widened(np.diag(inverse), pulls, inverse, clusters(pieces, problem.runs))
    wider = np.ones(len(known))
    wider[known] = np.sqrt(squares / np.diag(inverse))
    return fit.covariance * np.outer(wider, wider)


def clusters(pieces: Pieces, runs: Sequence[int] = ()) -> list[NDArray[np.int64]]:
    """Of every piece, its stretch of time; and its trial, where there are trials enough.

    Args:
        pieces: of the trials.
        runs: number of the run that each trial is a part of, one after the other; each is a run of
            its own if not given. What is slow in a run goes on from part to part.
    """
    run = np.asarray(runs)[pieces.trial] if len(runs) else pieces.trial
    order = np.arange(len(run)) - np.searchsorted(run, run)
    length, groups = round(BLOCK_S / INDEPENDENT_S), []
    while True:
        stretch = order // length
        group = run * (stretch.max() + 1) + stretch
        if groups and len(np.unique(group)) < LEAST_STRETCHES:
            break
        groups.append(group)
        if not stretch.any():
            break
        length *= 2
    if len(np.unique(pieces.trial)) >= LEAST_TRIALS:
        groups.append(pieces.trial)
    return groups


def widened(
    squares: Array, pulls: Array, inverse: Array, groups: Sequence[NDArray[np.int64]]
) -> Array:
    """Squared errors, or those by how pulls scatter between clusters where these are larger.

    Args:
        squares: of the curvature, shape (p,).
        pulls: of every piece at every parameter, shape (pieces, p).
        inverse: of the curvature, shape (p, p).
        groups: the cluster of every piece, in each way of making clusters.
    """
    for group in groups:
        _, index = np.unique(group, return_inverse=True)
        count = int(index.max()) + 1
        if count <= 1:
            continue
        summed = np.zeros((count, pulls.shape[1]))
        np.add.at(summed, index, pulls)
        moves = summed @ inverse
        squares = np.maximum(squares, count / (count - 1.0) * np.sum(moves**2, axis=0))
    return squares
