"""The fits of one round of the selection: candidates by score, and more where all are far off."""

from collections.abc import Callable, Sequence

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.selection.candidate_fits import fitted, restarted, unfitted

TRIED, NEAR = 8, 0.05
"""How many candidates are fitted at most, and the share of the best look's gain that one needs."""

Progress = Callable[[str, int, int], None]


def fits_of_candidates(
    problem: FitProblem,
    baseline: Baseline,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    scores: Sequence[ScreeningScore],
    journal: Journal,
    progress: Progress,
) -> tuple[dict[str, Fitted], tuple[str, ...]]:
    """Fits of the candidates that may be worth one, by name, and those that could not be fitted.

    Args:
        problem: the trials.
        baseline: the model that they are tried beside, ready to be looked beside.
        before: the same.
        chosen: the effects in it.
        scores: of all candidates, the best first.
        journal: keeps fits.
        progress: called with a step's name, what is done and the total.
    """
    fits: dict[str, Fitted] = {}
    worth = [each for each in scores if each.gain > NEAR * scores[0].gain and each.starts]
    for number, each in enumerate(worth[:TRIED]):
        progress(f"fitting effect {len(chosen) + 1}", number, len(worth[:TRIED]))
        refit = fitted(problem, baseline, before, chosen, each, journal)
        if refit is not None:
            fits[each.candidate.name] = refit
    beside, scored = (problem, baseline, before, chosen), dict(fits)
    fits |= restarted(*beside, worth, scored, fits, journal, progress)
    return fits, unfitted(*beside, worth[:TRIED], fits)
