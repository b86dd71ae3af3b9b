"""The fits of one round of the selection: candidates by score, and more where all are far off."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.selection.candidate_fits import fitted, restarted, unfitted
from pma_gym.discovery.selection.scanned_parameters import likeliest_scanned

TRIED, NEAR = 8, 0.05
"""How many candidates are fitted at most, and the share of the best look's gain that one needs."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Tried:
    """What fits of candidates led to: three attributes of `Stage`."""

    fits: dict[str, Fitted] = field(default_factory=dict)
    unfitted: tuple[str, ...] = ()
    scanned: Mapping[str, CandidateEffect] = field(default_factory=dict)


def fits_of_candidates(
    problem: FitProblem,
    baseline: Baseline,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    scores: Sequence[ScreeningScore],
    journal: Journal,
    progress: Progress,
) -> Tried:
    """Fits of the candidates that may be worth one.

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
    scanned = likeliest_scanned(problem, chosen, worth, fits, journal)
    fits |= {name: fit for name, (_, fit) in scanned.items()}
    better_ones = restarted(*beside, worth, scored, fits, journal, progress)
    fits |= better_ones
    moved = {name: each for name, (each, _) in scanned.items() if name not in better_ones}
    return Tried(fits, unfitted(*beside, worth[:TRIED], fits), moved)
