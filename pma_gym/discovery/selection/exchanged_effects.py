"""Exchange: another effect in the place of one that was selected before the others were there.

What is added first explains most by itself. Beside the effects that come later another one may
explain more: a spring stands for a hardening spring as long as damping that depends on direction is
missing.
"""

from collections.abc import Mapping, Sequence

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.selection.candidate_fits import cost, starting_values, stripped

TRIED = 4
"""How many effects are tried in the place of one: those that explained most there."""

LEAST = 30.0
"""Chi-square, in squared noises left, by which another must explain more."""

Chosen = tuple[CandidateEffect, ...]


def exchanged(
    problem: FitProblem,
    fit: Fitted,
    chosen: Chosen,
    rounds: Sequence[Mapping[str, Fitted]],
    candidates: Sequence[CandidateEffect],
) -> tuple[Chosen, Fitted]:
    """The effects and their fit, each in turn exchanged for one that explains more beside the rest.

    Args:
        problem: the trials.
        fit: the fit of the effects.
        chosen: the effects, in the order in which they were selected.
        rounds: the fits of all candidates in each round of the selection, by name.
        candidates: the whole catalogue.
    """
    known = {candidate.name: candidate for candidate in candidates}
    # The last was the best beside all others already.
    for place in range(len(chosen) - 1):
        taken = {each.name for each in chosen}
        fits = next((each for each in rounds if chosen[place].name in each), {})
        names = sorted(set(fits) - taken, key=lambda name: cost(fits[name]))[:TRIED]
        for name in names:
            others = (*chosen[:place], known[name], *chosen[place + 1 :])
            starts = {each.name: starting_values(each, fits[name], fit) for each in others}
            new = problem.fit(stripped(problem, fit), others, starts)
            least = LEAST * max(1.0, problem.left(fit) ** 2)
            if new is not None and cost(new) < cost(fit) - least:
                chosen, fit = others, new
    return chosen, fit
