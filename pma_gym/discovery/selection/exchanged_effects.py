"""Exchange: another effect in the place of one that was selected before the others were there.

What is added first explains most by itself. Beside the effects that come later another one may
explain more: a spring stands for a hardening spring as long as damping that depends on direction is
missing.
"""

from collections.abc import Mapping, Sequence

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.selection.candidate_fits import cost, starting_values, stripped
from pma_gym.discovery.selection.stages import Stage

TRIED = 4
"""How many effects are tried in the place of one: those that explained most there."""

LEAST_GAIN = 0.5
"""Share of an effect's gain that another must bring in its place there to be tried."""

LEAST = 30.0
"""Chi-square, in squared noises left, by which another must explain more."""

Chosen = tuple[CandidateEffect, ...]


def exchanged(
    problem: FitProblem,
    fit: Fitted,
    chosen: Chosen,
    stages: Sequence[Stage],
    candidates: Sequence[CandidateEffect],
) -> tuple[Chosen, Fitted]:
    """The effects and their fit, each in turn exchanged for one that explains more beside the rest.

    The last stays: it was the best beside all others already.

    Args:
        problem: the trials.
        fit: the fit of the effects.
        chosen: the effects, in the order in which they were selected.
        stages: of the selection.
        candidates: the whole catalogue.
    """
    known = {candidate.name: candidate for candidate in candidates}
    for place in range(len(chosen) - 1):
        taken = {each.name for each in chosen}
        fits, most = _near(chosen[place].name, stages)
        near = [name for name in set(fits) - taken if fits[name].chi_square < most]
        for name in sorted(near, key=lambda name: cost(fits[name]))[:TRIED]:
            others = (*chosen[:place], known[name], *chosen[place + 1 :])
            starts = {each.name: starting_values(each, fits[name], fit) for each in others}
            new = problem.fit(stripped(problem, fit), others, starts)
            least = LEAST * max(1.0, problem.left(fit) ** 2)
            if new is not None and cost(new) < cost(fit) - least:
                chosen, fit = others, new
    return chosen, fit


def _near(name: str, stages: Sequence[Stage]) -> tuple[Mapping[str, Fitted], float]:
    """Fits of the round in which an effect was selected, and the most chi-square that is near."""
    for stage in stages:
        if name in stage.fits:
            most = stage.before.chi_square
            return stage.fits, most - LEAST_GAIN * (most - stage.fits[name].chi_square)
    return {}, 0.0
