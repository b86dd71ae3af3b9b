"""A further term of the law of an effect that was selected: a seal rubs without pressure too.

Beside the first term the second changes little, too little to be looked for by itself. Left out it
makes the first one's size wrong by as much as both have in common.
"""

from collections.abc import Mapping

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.held_out import is_asked_for
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.selection.candidate_fits import LEAST_GAIN, cost, fitted
from pma_gym.discovery.selection.stages import Stage
from pma_gym.effects import CATALOGUE

Chosen = tuple[CandidateEffect, ...]


def further_terms(
    problem: FitProblem, best: Fitted, chosen: Chosen, stage: Stage, journal: Journal
) -> Mapping[str, Fitted]:
    """Fits of terms that explain more than their parameters cost, of readings left out too.

    Args:
        problem: the trials.
        best: the fit of the effects.
        chosen: the effects.
        stage: the round of the other candidates beside them.
        journal: keeps fits.
    """
    terms = {}
    for score in stage.scores:
        new = score.candidate
        law = CATALOGUE[new.effect]
        if not any(law.is_further_term(CATALOGUE[each.effect]) for each in chosen):
            continue
        fit = stage.fits.get(new.name)
        if fit is None:
            fit = fitted(problem, stage.baseline, best, chosen, score, journal)
        if fit is None or best.chi_square - fit.chi_square < LEAST_GAIN or cost(fit) > cost(best):
            continue
        if is_asked_for(problem, (fit, (*chosen, new)), (best, chosen)):
            terms[new.name] = fit
    return terms
