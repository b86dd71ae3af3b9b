"""Selection: which candidates are added to the model, one after the other.

In each round (`stages`) every candidate is scored; what passes the gate is fitted together with the
model's parameters; the likeliest is added; then the same again beside it. Each effect is then left
out once, and stays out if the fit is as good without it. Where nothing passes any more, further
terms of the laws that were added are fitted (`further_terms`). The noise is estimated again only
when all effects are selected: before, an autoregression would take the next effect for noise.

A further term of a law (a seal rubs without pressure too) changes little beside the first, too
little to be looked for by itself. Left out it makes the first one's size wrong by as much as both
have in common.

Another effect may stand in place of a term: a friction that falls with speed, or a quadratic drag.
A law with a further term explains some of what an effect beside it would, and the look beside the
whole law sees nothing left. So where the search ends, looks are taken beside the law without its
term too.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.covariance import covariance
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.held_out import is_asked_for
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.result.estimates import Undetermined
from pma_gym.discovery.screening.residuals import reestimated_noise
from pma_gym.discovery.selection.candidate_fits import (
    better,
    carries_the_rest,
    cost,
    fitted,
    refit,
    without_idle,
)
from pma_gym.discovery.selection.scanned_parameters import with_scanned
from pma_gym.discovery.selection.stages import Progress, Stage, stage_of
from pma_gym.discovery.selection.tied_laws import Chosen, Nested, fit_tied, simpler_laws
from pma_gym.discovery.thresholds import LEAST_GAIN, MOST_EFFECTS, SECOND_SHARE, SURE_SHARE
from pma_gym.effects import CATALOGUE


def instead_of_term(
    problem: FitProblem,
    fit: Fitted,
    chosen: Chosen,
    rest: Sequence[CandidateEffect],
    seed: int,
    journal: Journal,
    progress: Progress,
    is_worth: Callable[[Stage, float], bool],
) -> tuple[Stage, Chosen, Fitted] | None:
    """An effect that explains more beside a law without its term than the term does.

    Args:
        problem: the trials.
        fit: the fit of the effects.
        chosen: the effects.
        rest: the other candidates.
        seed: of simulated residuals.
        journal: keeps fits.
        progress: called with a step's name, what is done and the total.
        is_worth: whether an effect is worth adding in a round, by what it brings of chi-square.
    Returns:
        The round beside the law without its term, the effects and their fit; None where no effect
        has a term, or nothing that is worth it explains more.
    """
    state, least, best = Nested(chosen, fit, {}), cost(fit), None
    known = {candidate.name: candidate for candidate in rest}
    for place, candidate in enumerate(chosen):
        for tie in simpler_laws(candidate):
            simpler = None if tie.twin else fit_tied(problem, state, place, tie)
            if simpler is None:
                continue
            stage = stage_of(problem, simpler.fit, simpler.chosen, rest, seed, journal, progress)
            for name, other in stage.fits.items():
                gain = stage.before.chi_square - other.chi_square
                if cost(other) < least and is_worth(stage, gain):
                    least, best = cost(other), (stage, known[name], other)
    if best is None:
        return None
    stage, new, other = best
    # The term may still be there beside it: nested laws ask that.
    whole = problem.fit(other.model, (*chosen, new))
    return None if whole is None else (stage, (*chosen, new), whole)


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


BEGINNINGS = 3
"""How often the selection begins anew from a better refitted model."""


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
