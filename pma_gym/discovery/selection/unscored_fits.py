"""Fits of candidates that no score can judge, where a model is far from its trials.

A score follows straight lines from the refitted model. Many noises away from the trials they lead
nowhere: a pendulum without gravity is refitted to a motor that is all but locked, and beside that
friction changes nothing. So where no candidate that scored comes near, or explains the larger part,
the others are fitted too, from the parameters as they were given.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import PROBES, ScreeningScore
from pma_gym.discovery.selection.candidate_fits import fitted

LARGER_PART = 0.5
"""Share of chi-square from which on a fit shows that scores lead somewhere."""


def unscored_fits(
    problem: FitProblem,
    baseline: Baseline,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    scores: Sequence[ScreeningScore],
    fits: Mapping[str, Fitted],
    journal: Journal,
    progress: Callable[[str, int, int], None],
) -> dict[str, Fitted]:
    """Fits of candidates whose scores were not worth one; none where scores lead somewhere.

    Args:
        problem: the trials.
        baseline: the model that they are tried beside, ready to be looked beside.
        before: the same.
        chosen: the effects in it.
        scores: of candidates that were not fitted.
        fits: of those that were, by name.
        journal: keeps fits.
        progress: called with a step's name, what is done and the total.
    """
    more: dict[str, Fitted] = {}
    least = min((fit.chi_square for fit in fits.values()), default=before.chi_square)
    if least < LARGER_PART * before.chi_square or not all(map(problem.far, fits.values())):
        return more
    rest = [_over_probes(each) for each in scores if len(each.candidate.probes)]
    for number, each in enumerate(rest):
        progress(f"fitting effect {len(chosen) + 1} beyond its score", number, len(rest))
        fit = fitted(problem, baseline, before, chosen, each, journal)
        if fit is not None:
            more[each.candidate.name] = fit
    return more


def _over_probes(score: ScreeningScore) -> ScreeningScore:
    """A score that begins at probes all over the candidate's range, and promises nothing."""
    places = np.linspace(0, len(score.candidate.probes) - 1, PROBES).round().astype(int)
    starts = tuple((int(place), 1.0) for place in np.unique(places))
    return replace(score, gain=0.0, starts=starts)
