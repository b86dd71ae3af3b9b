"""The simpler law within an effect's law: fits in which the parameters that it ties are equal."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect, bounds
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.result.estimates import Undetermined
from pma_gym.effects import CATALOGUE

EQUAL = 5e-3
"""Share by which two parameters that are held equal may differ in the end."""

ROUNDS = 8
"""How often they are held equal anew, each time at what the other became."""

IDLE_SHARE = 0.1
"""Share of its usual value at which a parameter is held that does nothing in the simpler law. While
the two others still differ, a Stribeck speed far below the speeds of the trials leaves nearly all
readings to the second, and what that becomes does not depend on the first."""

Chosen = tuple[CandidateEffect, ...]


@dataclass(frozen=True)
class Nested:
    """Effects whose laws have lost what the trials do not determine.

    Attributes:
        chosen: the effects.
        fit: of the model with them.
        undetermined: what left, by path.
    """

    chosen: Chosen
    fit: Fitted
    undetermined: Mapping[str, Undetermined]


@dataclass(frozen=True)
class Tie:
    """Parameters by which a law becomes simpler.

    Attributes:
        path: the one that equals another in the simpler law, or that a term has as its size.
        twin: the other; empty where the simpler law is without the term.
        idle: those that do nothing there.
    """

    path: str
    twin: str
    idle: tuple[str, ...]


def below_twin(fit: Fitted, tie: Tie) -> bool:
    """Whether a parameter is below the one that it equals in the simpler law.

    A static friction below the dynamic one borrows the law's form for something else.
    """
    return bool(tie.twin) and fit.estimate(tie.path)[0] < fit.estimate(tie.twin)[0]


def simpler_laws(candidate: CandidateEffect) -> Iterator[Tie]:
    """The simpler laws of an effect whose parameters are fitted."""
    yield from ties(candidate)
    stems = _fitted(candidate)
    for size, *idle in CATALOGUE[candidate.effect].terms:
        if size in stems:
            yield Tie(stems[size], "", tuple(stems[stem] for stem in idle if stem in stems))


def ties(candidate: CandidateEffect) -> Iterator[Tie]:
    """Those of them in which two parameters are equal."""
    stems = _fitted(candidate)
    for one, other, *idle in CATALOGUE[candidate.effect].ties:
        if one in stems and other in stems:
            rest = tuple(stems[stem] for stem in idle if stem in stems)
            yield Tie(stems[one], stems[other], rest)


def _fitted(candidate: CandidateEffect) -> dict[str, str]:
    """Paths of an effect's fitted parameters by field name."""
    file_keys = CATALOGUE[candidate.effect].names_in_files()
    return {file_keys[path.partition(".")[2]]: path for path in candidate.fitted_paths}


def fit_held(
    problem: FitProblem,
    state: Nested,
    place: int,
    at: Mapping[str, float],
    begun: Mapping[str, float] | None = None,
) -> Nested | None:
    """The fit with some parameters of an effect held, others begun at values."""
    candidate = state.chosen[place]
    less = replace(candidate, left=(*candidate.left, *at))
    chosen = (*state.chosen[:place], less, *state.chosen[place + 1 :])
    refit = problem.fit(state.fit.model.replace({**at, **(begun or {})}), chosen)
    return None if refit is None else replace(state, chosen=chosen, fit=refit)


def idle_values(candidate: CandidateEffect, tie: Tie, share: float) -> dict[str, float]:
    """Values of what does nothing in the simpler law: a share of their usual ones, by path."""
    usual = dict(zip(candidate.paths, candidate.absent.tolist(), strict=True))
    lower, upper = bounds(tie.idle)
    clipped = np.clip([share * usual[path] for path in tie.idle], lower, upper)
    return dict(zip(tie.idle, clipped.tolist(), strict=True))


def fit_tied(problem: FitProblem, state: Nested, place: int, tie: Tie) -> Nested | None:
    """The best fit of the simpler law, in which some parameters do nothing.

    The first of two parameters equals the other, or a term's size is at its neutral value.
    """
    path, twin = tie.path, tie.twin
    if not twin:
        absent = dict(zip(state.chosen[place].paths, state.chosen[place].absent, strict=True))
        held = {path: float(absent[path])} | idle_values(state.chosen[place], tie, 1.0)
        return fit_held(problem, state, place, held)
    idle = idle_values(state.chosen[place], tie, IDLE_SHARE)
    best: Nested | None = None
    for size in (state.fit.estimate(twin)[0], state.fit.estimate(path)[0]):
        for _ in range(ROUNDS):
            new = fit_held(problem, state, place, {path: size} | idle, {twin: size})
            if new is None:
                break
            before, size = size, new.fit.estimate(twin)[0]
            if abs(size - before) < EQUAL * abs(size):
                if best is None or new.fit.chi_square < best.fit.chi_square:
                    best = new
                break
    return best
