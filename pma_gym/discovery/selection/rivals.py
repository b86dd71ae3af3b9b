"""Rivals: what explains the data nearly as well as an effect that was selected."""

from collections.abc import Sequence
from dataclasses import dataclass

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.selection.candidate_fits import cost, starting_values
from pma_gym.discovery.selection.stages import Stage
from pma_gym.discovery.thresholds import MOST_REFITTED, NEAREST, NEAREST_SHARE, REFITTED_RIVAL


@dataclass(frozen=True)
class Rival:
    """Another effect in the place of one that was selected.

    Attributes:
        candidate: it.
        fit: of the model with it.
        behind: chi-square by which it explains less, counting parameters; negative where more.
        equal: whether the data do not identify which of the two it is.
    """

    candidate: CandidateEffect
    fit: Fitted
    behind: float
    equal: bool


def rivals(
    problem: FitProblem,
    best: Fitted,
    chosen: Sequence[CandidateEffect],
    stage: Stage,
    place: int,
    candidates: Sequence[CandidateEffect],
) -> list[Rival]:
    """Rivals of one effect, the nearest first.

    Args:
        problem: with the noise that the selected model leaves.
        best: the selected model's fit.
        chosen: its effects.
        stage: the round in which the effect was selected.
        place: its place among the chosen.
        candidates: the whole catalogue.
    """
    own = stage.fits.get(chosen[place].name)
    if own is None:
        return []
    gain = stage.before.chi_square - own.chi_square
    taken = {candidate.name for candidate in chosen}
    near = sorted(
        (name for name, fit in stage.fits.items() if cost(fit) - cost(own) < REFITTED_RIVAL * gain),
        key=lambda name: cost(stage.fits[name]),
    )
    ranked = []
    for name in [name for name in near if name not in taken][:MOST_REFITTED]:
        candidate = next(each for each in candidates if each.name == name)
        others = [*chosen]
        others[place] = candidate
        starts = {each.name: starting_values(each, best, stage.fits[name]) for each in others}
        begun = problem.given.replace(
            {path: stage.fits[name].estimate(path)[0] for path in problem.own.free}
        )
        fit = problem.fit(begun, others, starts)
        if fit is None:
            continue
        behind = cost(fit) - cost(best)
        equal = behind < max(NEAREST, NEAREST_SHARE * gain)
        ranked.append(Rival(candidate, fit, behind, equal))
    return sorted(ranked, key=lambda rival: rival.behind)
