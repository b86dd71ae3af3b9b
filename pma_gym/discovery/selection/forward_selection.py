"""Selection: which candidates are added to the model, one after the other.

In each round (`stages`) every candidate is scored; what passes the gate is fitted together with the
model's parameters; the likeliest is added; then the same again beside it. Each effect is then left
out once, and stays out if the fit is as good without it. Where nothing passes any more, further
terms of the laws that were added are fitted (`further_terms`). The noise is estimated again only
when all effects are selected: before, an autoregression would take the next effect for noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.covariance import covariance
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.result.estimates import Undetermined
from pma_gym.discovery.screening.residuals import reestimated_noise
from pma_gym.discovery.selection.candidate_fits import (
    LEAST_GAIN,
    better,
    carries_the_rest,
    cost,
    refit,
    without_idle,
)
from pma_gym.discovery.selection.further_terms import further_terms
from pma_gym.discovery.selection.instead_of_terms import instead_of_term
from pma_gym.discovery.selection.scanned_parameters import with_scanned
from pma_gym.discovery.selection.stages import Stage, stage_of
from pma_gym.discovery.selection.tried_candidates import Progress

SECOND_SHARE, SURE_SHARE = 0.12, 0.02
"""Least share of the first effect's gain that another must bring: what a law of the catalogue
misses of its real likeness is of that order; and the same where the residual is surely no noise."""

BEGINNINGS = 3
"""How often the selection begins anew from a better refitted model."""

MOST_EFFECTS = 3
"""Most effects that are added."""


@dataclass(frozen=True)
class Selection:
    """What was selected.

    Attributes:
        stages: the rounds.
        chosen: the candidates in the model, in the order in which they came.
        fit: the model with them.
        problem: with the noise that it leaves.
        refitted: the model with its own parameters refitted alone; better than what the selection
            began with, where it had been caught.
        undetermined: parameters of the candidates that left their laws, by path (`nested_laws`).
    """

    stages: tuple[Stage, ...]
    chosen: tuple[CandidateEffect, ...]
    fit: Fitted
    problem: FitProblem
    refitted: Fitted
    undetermined: Mapping[str, Undetermined] = field(default_factory=dict)


def select(
    problem: FitProblem,
    refitted: Fitted,
    candidates: Sequence[CandidateEffect],
    seed: int,
    journal: Journal,
    progress: Progress,
) -> Selection:
    """Select candidates.

    Args:
        problem: the trials.
        refitted: the model with its own parameters refitted.
        candidates: the whole catalogue.
        seed: of simulated residuals.
        journal: keeps fits.
        progress: called with a step's name, what is done and the total.
    """
    added = _with_added(problem, refitted, candidates, seed, journal, progress)
    chosen, best = added.chosen, added.fit
    problem = replace(problem, noise=reestimated_noise(problem, best, chosen))
    fit = refit(problem, best, chosen, journal)
    chosen, fit = with_scanned(problem, fit, chosen, journal, ends_rigid=True)
    fit = replace(fit, covariance=covariance(problem, fit, chosen))
    return replace(added, chosen=chosen, fit=fit, problem=problem)


def _with_added(
    problem: FitProblem,
    refitted: Fitted,
    candidates: Sequence[CandidateEffect],
    seed: int,
    journal: Journal,
    progress: Progress,
) -> Selection:
    """All effects that the residual asks for, before their last fits."""
    chosen, stages, best, anew = (), [], refitted, 0
    while len(chosen) < MOST_EFFECTS:
        taken = {candidate.name for candidate in chosen}
        rest = [candidate for candidate in candidates if candidate.name not in taken]
        stage = stage_of(problem, best, chosen, rest, seed, journal, progress)
        added = _likeliest(stage, stages[0] if stages else stage)
        if added is None and chosen and stage.before is best:
            terms = further_terms(problem, best, chosen, stage, journal)
            stage = replace(stage, fits={**stage.fits, **terms})
            added = min(terms, key=lambda each: cost(terms[each]), default=None)
        stages.append(stage)
        if added is None:
            worth = partial(_is_worth, stages[0])
            other = instead_of_term(problem, best, chosen, rest, seed, journal, progress, worth)
            if other is not None:
                stages[-1], chosen, best = other
            break
        chosen = (*chosen, next(each for each in candidates if each.name == added))
        best = better(problem, stage.fits[added], chosen, journal)
        chosen, best = with_scanned(problem, best, chosen, journal)
        chosen, best = without_idle(problem, best, chosen, refitted, journal)
        if not chosen and best.chi_square < refitted.chi_square and anew < BEGINNINGS:
            # The fit without effects was in a local minimum; restart from the better parameters.
            refitted, stages = best, []
            anew += 1
        elif len(chosen) < len(stages):
            # One is not missed beside the other, and that is the end of it.
            break
    return Selection(tuple(stages), chosen, best, problem, refitted)


def _likeliest(stage: Stage, first: Stage) -> str | None:
    """The candidate to add, or None."""
    if not stage.gate or not stage.fits:
        return None
    passed = {each.candidate.name for each in stage.gate}
    most = stage.gate[0].gain
    # What did not pass may still explain more than what did: a look is linear, a fit is not.
    worth = {
        name: fit
        for name, fit in stage.fits.items()
        if name in passed or stage.before.chi_square - fit.chi_square > most
    }
    if not worth:
        return None
    name = min(worth, key=lambda each: cost(worth[each]))
    gain = stage.before.chi_square - stage.fits[name].chi_square
    return name if _is_worth(first, stage, gain) else None


def _is_worth(first: Stage, stage: Stage, gain: float) -> bool:
    """Whether an effect brings enough chi-square in a round to be added, beside the first one's."""
    if gain < LEAST_GAIN:
        return False
    if stage is first or carries_the_rest(stage.problem, stage.before, gain):
        return True
    least = min(first.fits.values(), key=cost)
    share = SURE_SHARE if stage.missing else SECOND_SHARE
    return gain >= share * (first.before.chi_square - least.chi_square)
