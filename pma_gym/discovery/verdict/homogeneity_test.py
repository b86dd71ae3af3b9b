"""Whether an effect is of one size in all trials and conditions: what is not has the wrong law."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.preparation.whitened_residuals import Pieces, WhitenedResiduals
from pma_gym.discovery.thresholds import CONDITION_GROUPS, LEAST_GAIN, LEAST_GROUPS, SURE
from pma_gym.effects import CATALOGUE
from pma_gym.estimation.least_squares import inverse

Array = NDArray[np.float64]

LEAST_PART = 1e-3
"""Share of the largest curvature below which a difference of sizes is none that data tell."""


def homogeneity_test(
    problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect], place: int
) -> Mapping[str, float]:
    """How much the size of an effect scatters beyond its errors, as a share of it.

    Terms of one law (a dry friction and its growth with the pressure) have one size, that of the
    law: a growth that is not quite in proportion is a small error of the friction, however large a
    share of the growth it is. Every group of pieces is given a size of its own, to first order,
    with all parameters refitted.

    Args:
        problem: the trials.
        fit: of a model with effects.
        chosen: the effects.
        place: of the one that is asked about.
    Returns:
        The scatter over trials (over files where trials are pieces of them), and over quarters of
        the pieces by contraction, load and pressure
        as simulated, by name; 0 where fewer than three groups show the effect, or where chance
        would scatter as much. Empty where the model cannot be simulated.
    """
    whitened = problem.whitened_at(fit, chosen)
    pieces = whitened.pieces(fit.values, fit.steps)
    if pieces is None:
        return {}
    direction, held = _direction_of_law(fit, chosen, place)
    if not direction.any():
        return {}
    curvature = pieces.products[:, 1:, 1:].sum(axis=0) + np.diag(whitened.prior**-2.0)
    own = np.zeros_like(curvature)
    free = np.flatnonzero(~held)
    own[np.ix_(free, free)] = inverse(curvature[np.ix_(free, free)])
    across = pieces.products[:, 1:, 1:] @ direction
    slopes = pieces.products[:, 1:, 0] @ direction + across @ _last_step(whitened, fit, pieces)
    return {
        name: _scatter(slopes, across, direction, own, group)
        for name, group in _groups(problem, whitened, fit, pieces).items()
    }


def _last_step(whitened: WhitenedResiduals, fit: Fitted, pieces: Pieces) -> Array:
    """What was left of a fit's way to the least chi-square, shape (p,).

    It is some hundredths of an error. But where a group sees an effect a thousand times as sharply
    as the others (by the instant at which a cable tightens), that is a slope as large as theirs.
    """
    gradient = pieces.products[:, 1:, 0].sum(axis=0)
    gradient += (fit.values - whitened.centre) / whitened.prior**2
    curvature = pieces.products[:, 1:, 1:].sum(axis=0) + np.diag(whitened.prior**-2.0)
    out = (fit.values <= whitened.lower) & (gradient > 0.0)
    out |= (fit.values >= whitened.upper) & (gradient < 0.0)
    return newton_step(gradient, curvature, ~out)


def newton_step(gradient: Array, curvature: Array, free: NDArray[np.bool_]) -> Array:
    """The step to the least of a quadratic, shape (p,).

    Args:
        gradient: shape (p,).
        curvature: shape (p, p).
        free: which parameters may move, shape (p,); those that nothing determines stay too.
    """
    step, moving = np.zeros_like(gradient), np.flatnonzero(free)
    if not len(moving):
        return step
    own = inverse(curvature[np.ix_(moving, moving)])
    known = np.isfinite(np.diag(own))
    step[moving[known]] = -own[np.ix_(known, known)] @ gradient[moving[known]]
    return step


def _direction_of_law(
    fit: Fitted, chosen: Sequence[CandidateEffect], place: int
) -> tuple[Array, NDArray[np.bool_]]:
    """How a fit's parameters move where an effect and all terms of its law grow; what is held.

    Sizes of several terms are held beside those of groups: a growth with the pressure would undo
    what a group of one pressure has of its own.
    """
    law = CATALOGUE[chosen[place].effect]
    terms = [each for each in chosen if CATALOGUE[each.effect].shares_law(law)]
    direction = np.sum([_direction(fit, each) for each in terms], axis=0)
    return direction, (direction != 0.0) & (len(terms) > 1)


def _direction(fit: Fitted, candidate: CandidateEffect) -> Array:
    """How a fit's parameters move where the effect as a whole grows."""
    direction = np.zeros(len(fit.paths))
    rows = zip(candidate.paths, candidate.absent, candidate.amplitudes, strict=True)
    for path, absent, scales in rows:
        if path in candidate.fitted_paths and (scales or len(candidate.paths) == 1):
            at = fit.paths.index(path)
            size = fit.values[at] - (absent if candidate.fitted.all() and scales else 0.0)
            direction[at] = size
    return direction


def _groups(
    problem: FitProblem, whitened: WhitenedResiduals, fit: Fitted, pieces: Pieces
) -> dict[str, NDArray[np.int64]]:
    """Group of every piece, by file and by conditions.

    A trial that is a second of a file has a start of its own, which its few readings hardly tell
    from the effect.
    """
    names = list(problem.files) or [str(i) for i in range(len(problem.trials))]
    number = {name: place for place, name in enumerate(dict.fromkeys(names))}
    file_of = np.array([number[name] for name in names], np.int64)
    groups: dict[str, NDArray[np.int64]] = {"trial": file_of[pieces.trial]}
    readings = whitened.readings(fit.values)
    if readings is None:
        return groups
    for channel, signal in enumerate(whitened.logged[0].signals):
        if signal.starts_at_zero:
            continue
        means = []
        for logged, held in zip(whitened.logged, readings, strict=True):
            edges = whitened.edges(logged)
            means += [held[channel, a:b].mean() for a, b in zip(edges, edges[1:], strict=False)]
        ranks = np.argsort(np.argsort(np.array(means), kind="stable"), kind="stable")
        groups[signal.name] = (CONDITION_GROUPS * ranks // len(ranks)).astype(np.int64)
    return groups


def _scatter(
    slopes: Array, across: Array, direction: Array, own: Array, group: NDArray[np.int64]
) -> float:
    """Scatter of sizes that every group has of its own, the model's parameters refitted beside."""
    count = int(group.max()) + 1
    slope = np.bincount(group, slopes, count)
    shared = np.zeros((count, across.shape[1]))
    np.add.at(shared, group, across)
    strength = shared @ direction
    seen = strength > SURE**2
    if seen.sum() < LEAST_GROUPS:
        return 0.0
    known = np.isfinite(np.diag(own))
    shared = shared[:, known][seen]
    left = np.diag(strength[seen]) - shared @ own[np.ix_(known, known)] @ shared.T
    errors = np.linalg.pinv(left, rcond=LEAST_PART, hermitian=True)
    if slope[seen] @ errors @ slope[seen] < LEAST_GAIN:
        return 0.0
    # All groups alike is the effect itself, which the fit has placed where it is best.
    sizes = 1.0 - errors @ slope[seen]
    weights = strength[seen] / strength[seen].sum()
    mean = float(weights @ sizes)
    centred = np.eye(len(sizes)) - weights
    chance = float(weights @ np.diag(centred @ errors @ centred.T))
    beyond = float(weights @ (sizes - mean) ** 2) - chance
    return float(np.sqrt(max(0.0, beyond))) / max(abs(mean), 1e-9)
