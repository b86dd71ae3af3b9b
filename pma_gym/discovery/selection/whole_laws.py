"""Fits of a whole law begun at the simpler law within it, and the spread of their optima.

Dry friction with a static level makes a slide stick and slip: chi-square has many minima, and where
a search ends depends on where it begins. The whole law begins a little above the simpler one, at
several values of what does nothing there (a Stribeck speed). All fits that explain the trials about
as well as the best say how well the parameters are known.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.covariance import covariance
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.selection.tied_laws import Chosen, Tie, below_twin, idle_values
from pma_gym.discovery.thresholds import AS_GOOD, CONFIDENCE

Array = NDArray[np.float64]

STARTS = ((1.1, 0.5), (1.25, 1.0), (1.4, 2.0))
"""How many times as large as its twin a parameter begins that the simpler law ties to it, and at
which share of its usual value what does nothing in the simpler law."""


def begun_above(
    problem: FitProblem, simpler: Fitted, chosen: Chosen, place: int, tie: Tie
) -> Fitted | None:
    """The whole law of an effect begun a little above the simpler one, with the spread of its fits.

    None where no fit ends with the first of two parameters above its twin.

    Args:
        problem: the trials, with the noise that the fit leaves.
        simpler: a fit of the simpler law.
        chosen: the effects, with the whole law.
        place: of the effect in them.
        tie: what makes its law simpler; of two parameters, or nothing is begun.
    """
    if not tie.twin:
        return None
    begun = (
        problem.fit(simpler.model.replace(start), chosen)
        for start in _starts(chosen[place], tie, simpler)
    )
    fits = [each for each in begun if each is not None and not below_twin(each, tie)]
    if not fits:
        return None
    best = min(fits, key=_chi_square)
    # Pulls at a fit that stopped short of its optimum say nothing of how sure its values are.
    equals = [(each.values, each.values) for each in _equals(problem, fits, chosen)]
    return _with_spread(best, [_interval(problem, best, chosen), *equals])


def _with_spread(best: Fitted, ends: Sequence[tuple[Array, Array]]) -> Fitted:
    """A fit with the least and greatest values of intervals, shape (parameters,) each."""
    low = np.min([best.values, *(each[0] for each in ends)], axis=0).tolist()
    high = np.max([best.values, *(each[1] for each in ends)], axis=0).tolist()
    return replace(best, spread=dict(zip(best.paths, zip(low, high, strict=True), strict=True)))


def _interval(problem: FitProblem, fit: Fitted, chosen: Chosen) -> tuple[Array, Array]:
    """Intervals of the parameters at one optimum; the values where it does not tell them."""
    variances = np.diag(covariance(problem, fit, chosen))
    known = np.isfinite(variances) & (variances > 0.0)
    error = CONFIDENCE * np.sqrt(np.where(known, variances, 0.0))
    return fit.values - error, fit.values + error


def _starts(candidate: CandidateEffect, tie: Tie, simpler: Fitted) -> Iterator[dict[str, float]]:
    """Values a little off the simpler law."""
    size = simpler.estimate(tie.twin)[0]
    most = float(candidate.bounds[1][candidate.paths.index(tie.path)])
    for above, share in STARTS:
        yield {tie.path: min(above * size, most)} | idle_values(candidate, tie, share)


def _equals(problem: FitProblem, fits: Sequence[Fitted], chosen: Chosen) -> list[Fitted]:
    """Fits that explain the trials about as well as the best of them.

    Vuong's test: the sum of the difference of chi-square over the trials, against their scatter.
    """
    parts = [_chi_squares(problem, each, chosen) for each in fits]
    if not parts:
        return []
    best = min(parts, key=np.sum)
    most = AS_GOOD * float(best.sum())
    pairs = zip(fits, parts, strict=True)
    return [fit for fit, part in pairs if part.sum() < most and _is_by_chance(part - best)]


def _chi_squares(problem: FitProblem, fit: Fitted, chosen: Chosen) -> Array:
    """Chi-square of a fit in each trial."""
    pieces = problem.whitened_at(fit, chosen).pieces(fit.values, np.empty(0))
    if pieces is None:
        return np.full(len(problem.trials), np.inf)
    return np.bincount(pieces.trial, pieces.products[:, 0, 0]).astype(np.float64)


def _is_by_chance(differences: Array) -> bool:
    """Whether differences add up to no more than chance would have them."""
    count = len(differences)
    if not np.isfinite(differences).all() or count <= 1:
        return False
    chance = CONFIDENCE * np.sqrt(count) * differences.std(ddof=1)
    return bool(differences.sum() <= chance)


def _chi_square(fit: Fitted) -> float:
    return fit.chi_square
