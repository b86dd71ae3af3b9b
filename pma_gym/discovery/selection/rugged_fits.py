"""Fits whose chi-square is rugged: several starts, no derivatives, and the spread of the optima.

Dry friction with a static level makes a slide stick and slip. Where a fit of such a law does not
converge, chi-square has many minima in a narrow, bent valley, and where a search ends depends on
where it begins. The law then enters as one number first, the simpler law within it. The whole law
begins a little above that, at several values of what does nothing there (a Stribeck speed), and its
fits are eased (`FitProblem.eased_fit`). The best are fitted again and refined without derivatives.
All that explain the trials about as well as the best say how well the parameters are known.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.covariance import covariance
from pma_gym.discovery.fitting.derivative_free import refined
from pma_gym.discovery.fitting.fit_problem import SURE, FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import values
from pma_gym.discovery.selection.tied_laws import (
    IDLE_SHARE,
    Chosen,
    Nested,
    Tie,
    below_twin,
    fit_held,
    idle_values,
    ties,
)

Array = NDArray[np.float64]

TIED, NEAR = 4, 0.02
"""How often the simpler law's number is fitted at most, each time with its twin at what it became;
the share by which both may differ in the end."""

STARTS = (
    (1.1, 0.5),
    (1.25, 1.0),
    (1.4, 2.0),
    (1.1, 0.2),
    (1.1, 1.0),
    (1.1, 2.0),
    (1.25, 0.5),
    (1.4, 0.5),
    (1.4, 1.0),
)
"""How many times as large as its twin a parameter begins that the simpler law ties to it, and at
which share of its usual value what does nothing in the simpler law."""

FIRST, WORTH = 3, 0.05
"""How many of them are tried first, and the share of the simpler law's chi-square that they must
gain for the others to be tried: where the whole law explains no more, its optima do not matter.
Assumptions; an axis of three effects ended alike with nine of them and with three."""

FITTED, REFINED = 4, 2
"""How many of the eased fits are fitted again, and how many are refined."""

ALIKE = 4.0
"""How many times the least chi-square one may have that explains about as well, a residual twice as
large: where one trial outweighs all others, chance alone would allow anything."""

AT_NOISE = 1.1
"""Noises up to which a fit counts as at the noise: an assumption."""


def is_rugged(fit: Fitted, chosen: Chosen) -> bool:
    """Whether a fit stopped without converging, with a law that a simpler one is within."""
    return not fit.converged and any(True for each in chosen for _ in ties(each))


def best_of_optima(
    problem: FitProblem, fit: Fitted, chosen: Chosen, refines: bool = True
) -> Fitted:
    """The least of the minima that several starts lead to, with the spread of the equal ones.

    Args:
        problem: the trials.
        fit: a fit that did not converge; one of the starts.
        chosen: the effects in it.
        refines: whether the best fits are refined without derivatives, which takes longest.
    """
    begun = sorted(_fits_from_simpler_laws(problem, fit, chosen), key=_chi_square)
    fits = [fit, *filter(None, (problem.fit(each.model, chosen) for each in begun[:FITTED]))]
    fits.sort(key=_chi_square)
    if refines:
        fits[:REFINED] = [refined(problem, each, chosen) for each in fits[:REFINED]]
    best = min(fits, key=_chi_square)
    equals = [*_equals(problem, begun, chosen), *_equals(problem, fits, chosen)]
    ends = [_interval(problem, each, chosen) for each in equals]
    return _with_spread(best, ends)


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
        for start in islice(_starts(chosen[place], tie, simpler), FIRST)
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
    error = SURE * np.sqrt(np.where(known, variances, 0.0))
    return fit.values - error, fit.values + error


def settled(problem: FitProblem, fit: Fitted, chosen: Chosen) -> Fitted:
    """A fit near an optimum, refined; or the best of more optima where that does not converge.

    A fit that leaves little more than the noise is not begun anew: others hardly leave less. Nor is
    one refined that `nested_laws` begins again or leaves for the simpler law.

    Args:
        problem: the trials, with the noise that the fit leaves.
        fit: the fit; its spread is kept.
        chosen: the effects in it.
    """
    if all(below_twin(fit, tie) for candidate in chosen for tie in ties(candidate)):
        return fit
    refit = refined(problem, fit, chosen, narrows=True)
    if refit.converged or problem.left(refit) < AT_NOISE:
        return refit
    return best_of_optima(problem, refit, chosen)


def _fits_from_simpler_laws(problem: FitProblem, fit: Fitted, chosen: Chosen) -> Iterator[Fitted]:
    """Fits begun at a simpler law of an effect, with the model's own parameters as given."""
    own = dict(zip(problem.own.free, values(problem.given, problem.own.free).tolist(), strict=True))
    begun = replace(fit, model=fit.model.replace(own))
    for place, candidate in enumerate(chosen):
        for tie in ties(candidate):
            simpler = _simpler(problem, begun, chosen, place, tie)
            if simpler is None:
                continue
            left, least = max(1.0, problem.left(simpler)), simpler.chi_square
            for number, start in enumerate(_starts(candidate, tie, simpler)):
                if number == FIRST and least > (1.0 - WORTH) * simpler.chi_square:
                    break
                model = simpler.model.replace(start)
                new = problem.eased_fit(model, chosen, left)
                if new is not None:
                    least = min(least, new.chi_square)
                    yield new


def _simpler(
    problem: FitProblem, fit: Fitted, chosen: Chosen, place: int, tie: Tie
) -> Fitted | None:
    """A fit of the simpler law of an effect, about as well as a start needs."""
    idle = idle_values(chosen[place], tie, IDLE_SHARE)
    # Where the first is below its twin, the twin may be what a law far above all speeds tends to.
    size = min(fit.estimate(tie.twin)[0], fit.estimate(tie.path)[0])
    simpler = fit
    for _ in range(TIED):
        state = Nested(chosen, simpler, {})
        new = fit_held(problem, state, place, {tie.path: size} | idle, {tie.twin: size})
        if new is None:
            return None
        simpler, before = new.fit, size
        size = simpler.estimate(tie.twin)[0]
        if abs(size - before) < NEAR * abs(size):
            break
    return simpler


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
    most = ALIKE * float(best.sum())
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
    if not np.isfinite(differences).all() or count < 2:
        return False
    chance = SURE * np.sqrt(count) * differences.std(ddof=1)
    return bool(differences.sum() <= chance)


def _chi_square(fit: Fitted) -> float:
    return fit.chi_square
