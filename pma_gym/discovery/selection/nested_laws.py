"""Nested laws: parameters of an effect that the trials do not determine leave its law.

The profile of a parameter is chi-square with the parameter held and all others refitted. Where it
stays within `FLAT` of its least up to a limit of the law (a Stribeck speed far above all speeds),
the parameter is not determined: it is held at that limit, the fit is repeated without it, and no
value is given for it, only the bound that the profile has on the other side. An effect may also
say that a simpler law of its own sets one parameter equal to another (`Effect.ties`) or lacks a
term (`Effect.terms`); the whole law stays where it explains more than its further parameters cost,
of readings left out too, and where the parameter that may be equal is surely above the other and
not at an end of its range: a static friction of 0 N, or below the dynamic one, borrows the law's
form for something else. So does one whose Stribeck speed may be the least that there is. Where a
whole law explains more than its further parameters cost and is not taken all the same, the
intervals of what both laws have hold what the whole law says of it: friction without its rise near
rest is larger, and damping beside it smaller. Where the one number leaves more than three noises
and the whole law does not, or twice the residual, the whole law stays.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pma_gym.discovery.fitting.covariance import covariance
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import at_limit, unit
from pma_gym.discovery.fitting.held_out import is_asked_for
from pma_gym.discovery.result.estimates import Undetermined
from pma_gym.discovery.selection.candidate_fits import cost
from pma_gym.discovery.selection.profile_limits import limits
from pma_gym.discovery.selection.tied_laws import (
    Chosen,
    Nested,
    Tie,
    below_twin,
    fit_held,
    fit_tied,
    simpler_laws,
)
from pma_gym.discovery.selection.whole_laws import begun_above
from pma_gym.discovery.thresholds import AS_GOOD, FLAT, SURE

HALVINGS = 5
"""How often the place where a profile leaves its flat is halved."""


def nested(problem: FitProblem, fit: Fitted, chosen: Chosen) -> Nested:
    """Take from effects what the trials do not determine, one parameter after the other.

    Args:
        problem: the trials, with the noise that the fit leaves.
        fit: of the model with the effects.
        chosen: the effects.
    """
    state = Nested(chosen, fit, {})
    paths = [path for candidate in chosen for path in candidate.fitted_paths]
    state = _all_tied(problem, state)
    for path in paths:
        state = _left(problem, state, path) or state
    # What only mattered together with a parameter that has left does nothing any more.
    state = _all_tied(problem, state)
    if state.fit is fit:
        return state
    fit = replace(state.fit, covariance=covariance(problem, state.fit, state.chosen))
    return replace(state, fit=fit)


def _left(problem: FitProblem, state: Nested, path: str) -> Nested | None:
    """Without a parameter whose profile is flat up to a limit; None where it is determined."""
    place = _place(state.chosen, path)
    candidate = state.chosen[place]
    shape = not candidate.amplitudes[candidate.paths.index(path)]
    if path not in candidate.fitted_paths or len(candidate.fitted_paths) <= 1:
        return None
    value, error = state.fit.estimate(path)
    # A size goes only where the trials do not show it at all: a friction by what nothing carries.
    if not shape and np.isfinite(error):
        return None
    low, high = limits(problem, state.fit, state.chosen, path)
    doubtful = [
        end
        for end in (low, high)
        if not np.isfinite(error) or abs(value - end) < SURE * error or _beyond(value, end, low)
    ]
    held = {end: fit_held(problem, state, place, {path: end}) for end in doubtful}
    flat = {end: new for end, new in held.items() if new is not None and _flat(state.fit, new.fit)}
    if not flat:
        return None
    end = min(flat, key=lambda each: flat[each].fit.chi_square)
    other = low if end == high else high
    bound = None
    if other not in flat:
        bound = _bound(problem, state, place, path, (min(max(value, low), high), other))
    sides = (bound, None) if end == high else (None, bound)
    known = Undetermined(*sides, unit(path))
    return replace(flat[end], undetermined={**state.undetermined, path: known})


def _beyond(value: float, end: float, low: float) -> bool:
    """Whether a value is at a limit of its law, or beyond."""
    return value <= end if end == low else value >= end


def _flat(best: Fitted, held: Fitted) -> bool:
    return held.chi_square - best.chi_square < FLAT


def _bound(
    problem: FitProblem, state: Nested, place: int, path: str, ends: tuple[float, float]
) -> float | None:
    """Where a profile has risen by `FLAT`, between where it is flat and where it is not."""
    flat, steep = ends
    logarithmic = min(ends) > 0.0
    for _ in range(HALVINGS):
        middle = float(np.sqrt(flat * steep) if logarithmic else 0.5 * (flat + steep))
        new = fit_held(problem, state, place, {path: middle})
        if new is not None and _flat(state.fit, new.fit):
            flat = middle
        else:
            steep = middle
    return steep


def _all_tied(problem: FitProblem, state: Nested) -> Nested:
    """With the simpler law of each effect that has one and bears it."""
    for place in range(len(state.chosen)):
        state = _tied(problem, state, place)
    return state


def _tied(problem: FitProblem, state: Nested, place: int) -> Nested:
    """With the first simpler law of an effect that the trials do not refuse.

    A whole law that does not stay is begun again at the simpler one first: it may have ended in a
    local minimum.
    """
    for tie in simpler_laws(state.chosen[place]):
        simpler = fit_tied(problem, state, place, tie)
        if simpler is None:
            continue
        fit = simpler.fit
        for whole in _whole_laws(problem, state, simpler, place, tie):
            if not _explains_more(whole, simpler, tie):
                continue
            if _ended(problem, whole, tie.path) or not is_asked_for(
                problem, (whole.fit, whole.chosen), (simpler.fit, simpler.chosen)
            ):
                fit = _as_wide(fit, whole.fit)
                continue
            # A simpler law that is far from the trials gives the other parameters false values.
            nearer = whole.fit.chi_square * AS_GOOD < simpler.fit.chi_square
            nearer |= problem.far(simpler.fit) and not problem.far(whole.fit)
            if nearer or _is_shown(problem, whole, tie):
                state = whole
                break
            fit = _as_wide(fit, whole.fit)
        else:
            left = (tie.path, *tie.idle)
            known = {each: Undetermined(None, None, unit(each)) for each in left}
            return replace(simpler, fit=fit, undetermined={**state.undetermined, **known})
    return state


def _is_shown(problem: FitProblem, whole: Nested, tie: Tie) -> bool:
    """Whether intervals set two numbers of a law apart, or one from 0, and leave out what hides it.

    All optima that explain the trials about as well are counted. The least value of what does
    nothing in the simpler law, as a Stribeck speed, hides the first number from every motion.
    """
    twin = whole.fit.interval(tie.twin)[1] if tie.twin else 0.0
    apart = whole.fit.interval(tie.path)[0] > twin
    lows = [(whole.fit.interval(each)[0], _range(problem, whole, each)[0]) for each in tie.idle]
    return apart and all(low > least for low, least in lows)


def _as_wide(simpler: Fitted, whole: Fitted) -> Fitted:
    """The simpler law's fit, with what the whole law says of its parameters in their spread.

    Where the whole law explains more, but not surely which of its numbers does, each of them may
    be what it is there.
    """
    spread = dict(simpler.spread)
    for path in simpler.paths:
        low, high = whole.interval(path)
        if np.isfinite(high - low):
            value = simpler.estimate(path)[0]
            least, most = spread.get(path, (value, value))
            spread[path] = min(low, least), max(high, most)
    return replace(simpler, spread=spread)


def _whole_laws(
    problem: FitProblem, state: Nested, simpler: Nested, place: int, tie: Tie
) -> Iterator[Nested]:
    """The whole law of an effect as it was fitted, and begun at the simpler one."""
    yield state
    fit = begun_above(problem, simpler.fit, state.chosen, place, tie)
    if fit is not None:
        yield replace(state, fit=fit)


def _explains_more(whole: Nested, simpler: Nested, tie: Tie) -> bool:
    """Whether the whole law of an effect explains more than its further parameters cost."""
    return cost(whole.fit) <= cost(simpler.fit) and not below_twin(whole.fit, tie)


def _ended(problem: FitProblem, state: Nested, path: str) -> bool:
    """Whether a parameter is at an end of the range that its fit had."""
    value, error = state.fit.estimate(path)
    lower, upper = _range(problem, state, path)
    # A range may be a million times as wide as the value: what is surely off its end is not there.
    surely = lower + SURE * error < value < upper - SURE * error
    return bool(at_limit(value, lower, upper)) and not surely


def _range(problem: FitProblem, state: Nested, path: str) -> tuple[float, float]:
    """The range of a parameter in a fit."""
    whitened = problem.whitened_at(state.fit, state.chosen)
    at = [free.path for free in whitened.free].index(path)
    return float(whitened.lower[at]), float(whitened.upper[at])


def _place(chosen: Chosen, path: str) -> int:
    return next(k for k, candidate in enumerate(chosen) if path in candidate.paths)
