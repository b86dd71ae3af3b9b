"""Selection: which candidates are added to the model, one after the other.

The gate is the score test: chance explains as much, over the whole catalogue, in one of two hundred
data sets. It opens too where the residual itself is no noise: where it is many times as large
(`far_off`), where it is autocorrelated beyond the noise (`autocorrelation`), or where single pieces
are too large for noise (`scan_statistic`) and an effect explains them. What passes is fitted
together with the model's parameters; the likeliest is added; then the same again beside it. Each
effect is then left out once, and stays out if the fit is as good without it, or is exchanged for
another that explains more beside the rest. Where a free rig is far from its trials all this happens
in short pieces of them first, and goes on in the trials beside what holds there. The noise is
estimated again only when all effects are selected: before, an autoregression would take the next
effect for noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.covariance import covariance
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.fitting.short_pieces import in_short_pieces
from pma_gym.discovery.result.estimates import Undetermined
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.residuals import (
    far_off,
    is_autocorrelated,
    reestimated_noise,
    scan_of_fit,
)
from pma_gym.discovery.screening.scan_statistic import NO_EXCESS, ScanStatistic
from pma_gym.discovery.screening.score_test import ScreeningScore, screen
from pma_gym.discovery.screening.starting_points import refined_score
from pma_gym.discovery.selection.candidate_fits import (
    MOST_LEFT,
    better,
    carries_the_rest,
    cost,
    probed,
    refit,
    without_idle,
)
from pma_gym.discovery.selection.exchanged_effects import Round, exchanged
from pma_gym.discovery.selection.rugged_fits import is_rugged, settled
from pma_gym.discovery.selection.scanned_parameters import with_scanned
from pma_gym.discovery.selection.tried_candidates import Progress, Tried, fits_of_candidates

ALARM = 0.005
"""Family-wise rate of false alarms that the gate lets through."""

LEAST_CHANGE = 0.15
"""Least rms of what an effect changes beyond parameters, over the noise of the signal where that is
most: what is smaller is not worth a name, and no model's arithmetic is that exact."""

PIECES_CHANGE = 0.05
"""The same of pieces of a trial, each with its own start: that takes up most of what an effect does
in the whole trial. An assumption: friction or a spring as large as the noise shows so little."""

COARSE_CHANGE = 0.5
"""The same beside a sensor whose readings keep to coarse steps: what is lost between them is no
noise, and follows the motion."""

SECOND_SHARE, SURE_SHARE = 0.12, 0.02
"""Least share of the first effect's gain that another must bring: what a law of the catalogue
misses of its real likeness is of that order; and the same where the residual is surely no noise."""

BEGINNINGS = 3
"""How often the selection begins anew from a better refitted model."""

MOST_EFFECTS = 3
"""Most effects that are added."""

SHORT_PIECES = 40
"""How many short pieces of a free rig's trials are searched first."""

CARRIED = 0.5
"""Share of the bursts in a residual that a fit must explain, where they alone opened the gate:
noise that is larger in places bursts too, and no effect explains half of that."""


@dataclass(frozen=True)
class Stage:
    """One round of the selection.

    Attributes:
        problem: with the noise of this round.
        before: the model that candidates were tried beside.
        baseline: the same, ready to be looked beside.
        scores: at every candidate.
        fits: of those that were fitted, by name, each together with what was there before.
        gate: the looks that passed.
        missing: whether the residual says of itself that something is missing.
        scan: pieces of it that opened the gate by themselves.
        unfitted: candidates that could not be fitted: their range, simulated, promises more than
            any fit brings, and their own fits bring far less although a refit keeps the promise.
        scanned: candidates that were fitted with held parameters at other values, by name.
        scale: how many times as large chi-square is in the trials; not 1 where the round was of
            short pieces of them.
    """

    problem: FitProblem
    before: Fitted
    baseline: Baseline
    scores: tuple[ScreeningScore, ...]
    fits: dict[str, Fitted]
    gate: tuple[ScreeningScore, ...]
    missing: bool
    scan: ScanStatistic = NO_EXCESS
    unfitted: tuple[str, ...] = ()
    scanned: Mapping[str, CandidateEffect] = field(default_factory=dict)
    scale: float = 1.0


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
    begun = Added((), (), refitted, refitted)
    if problem.given.rig.is_free and problem.far(refitted):
        begun = _begun_in_short_pieces(problem, begun, candidates, seed, journal, progress)
    added = _with_added(problem, begun, candidates, seed, journal, progress)
    chosen, best, refitted = added.chosen, added.fit, added.refitted
    # The last was the best beside all others already.
    rounds, places = _rounds(added.stages), range(len(chosen) - 1)
    chosen, best = exchanged(problem, best, chosen, rounds, candidates, places)
    problem = replace(problem, noise=reestimated_noise(problem, best, chosen))
    fit = refit(problem, best, chosen, journal)
    if is_rugged(fit, chosen):
        fit = settled(problem, replace(fit, spread=best.spread), chosen)
    fit = replace(fit, covariance=covariance(problem, fit, chosen))
    return Selection(added.stages, chosen, fit, problem, refitted)


@dataclass(frozen=True)
class Added:
    """Effects that were added one after the other: as `Selection`, before its last fits.

    Attributes:
        chosen: the effects.
        stages: the rounds.
        fit: the model with them.
        refitted: the model with its own parameters refitted alone.
    """

    chosen: tuple[CandidateEffect, ...]
    stages: tuple[Stage, ...]
    fit: Fitted
    refitted: Fitted


def _begun_in_short_pieces(
    problem: FitProblem,
    begun: Added,
    candidates: Sequence[CandidateEffect],
    seed: int,
    journal: Journal,
    progress: Progress,
) -> Added:
    """What short pieces of a free rig's trials say is missing, where that holds for the trials.

    In a second an error of force leads a free rig so far away that fits of the right effect end in
    local minima, and that effects beside it do not show. In a quarter of a second it does not.
    """
    short = in_short_pieces(problem, SHORT_PIECES)
    refitted = short.careful_fit(problem.given)
    if short is problem or refitted is None:
        return begun
    first = Added((), (), refitted, refitted)
    added = _with_added(short, first, candidates, seed, journal, progress)
    chosen, scale = added.chosen, begun.fit.chi_square / added.refitted.chi_square
    stages = tuple(replace(each, scale=scale) for each in added.stages[: len(chosen)])
    if not chosen:
        return begun
    fit = problem.fit(added.fit.model, chosen)
    if fit is None or not fit.chi_square < MOST_LEFT * begun.fit.chi_square:
        return begun
    # What explains most in short pieces need not in longer ones.
    places = range(len(chosen))
    chosen, fit = exchanged(problem, fit, chosen, _rounds(stages), candidates, places)
    return replace(begun, chosen=chosen, stages=stages, fit=replace(fit, spread=added.fit.spread))


def _rounds(stages: Sequence[Stage]) -> list[Round]:
    return [(each.before, each.fits) for each in stages]


def _with_added(
    problem: FitProblem,
    begun: Added,
    candidates: Sequence[CandidateEffect],
    seed: int,
    journal: Journal,
    progress: Progress,
) -> Added:
    """With all effects that the residual asks for, beside those there are."""
    chosen, stages = begun.chosen, list(begun.stages)
    best, refitted, anew = begun.fit, begun.refitted, 0
    while len(chosen) < MOST_EFFECTS:
        taken = {candidate.name for candidate in chosen}
        rest = [candidate for candidate in candidates if candidate.name not in taken]
        stage = _stage(problem, best, chosen, rest, seed, journal, progress)
        stages.append(stage)
        added = _likeliest(stage, stages[0])
        if added is None:
            break
        new = next(each for each in candidates if each.name == added)
        chosen = (*chosen, stage.scanned.get(added, new))
        best = better(problem, stage.fits[added], chosen, stage.before, journal)
        chosen, best = with_scanned(problem, best, chosen, journal)
        chosen, best = without_idle(problem, best, chosen, refitted, journal)
        if not chosen and best.chi_square < refitted.chi_square and anew < BEGINNINGS:
            # The fit without effects was in a local minimum; restart from the better parameters.
            refitted, stages = best, []
            anew += 1
        elif len(chosen) < len(stages):
            # One is not missed beside the other, and that is the end of it.
            break
    return Added(chosen, tuple(stages), best, refitted)


def _stage(
    problem: FitProblem,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    rest: Sequence[CandidateEffect],
    seed: int,
    journal: Journal,
    progress: Progress,
) -> Stage:
    shared, astray = problem, problem.astray(before)
    if astray:
        problem, before = _as_assumed(problem, before, chosen)
    step = f"looking for effect {len(chosen) + 1}"
    progress(step, 0, len(rest))
    baseline = Baseline.at(
        problem.whitened_residuals(before.model, chosen), before.values, before.steps
    )
    scores = screen(
        baseline,
        rest,
        seed + len(chosen),
        lambda candidate: probed(problem, before, candidate),
        lambda done: progress(step, done, len(rest)),
    )
    scores.sort(key=lambda each: -each.gain)
    # Where the residual itself rules chance out, a look need not.
    far = far_off(problem, before, chosen)
    missing = far or is_autocorrelated(problem, before, chosen)
    gate = tuple(each for each in scores if passes(problem, each, far or (missing and not chosen)))
    scan = NO_EXCESS if gate or chosen else scan_of_fit(problem, before)
    least, plainly = 0.0, scores
    if scan.excess:
        rows = sum(len(trial.time) for trial in problem.trials)
        # As large as a change must be, were it all in one signal.
        least = max(CARRIED * scan.excess, _least_change(problem) ** 2 * rows)
        scores = _refined_scores(problem, baseline, before, scores, scan.chance, least)
        gate = tuple(each for each in scores if each.starts)
    tried = Tried()
    if gate:
        beside = problem, baseline, before, chosen
        # Short pieces of a free rig's trials lead second fits out of local minima already.
        restarts = not astray and not (problem.given.rig.is_free and chosen)
        tried = fits_of_candidates(*beside, scores, far, restarts, journal, progress)
    gains = [before.chi_square - fit.chi_square for fit in tried.fits.values()]
    if scan.excess and all(gain < least for gain in gains):
        gate, tried, scores, scan = (), replace(tried, fits={}), plainly, NO_EXCESS
    return Stage(
        shared,
        before,
        baseline,
        tuple(scores),
        tried.fits,
        gate,
        missing,
        scan,
        tried.unfitted,
        tried.scanned,
    )


def _as_assumed(
    problem: FitProblem, before: Fitted, chosen: tuple[CandidateEffect, ...]
) -> tuple[FitProblem, Fitted]:
    """Trials and fit within what was assumed of the parameters.

    A motor that is all but locked hides what holds it. Looks and fits begin beside what was assumed
    of the parameters, and stay there until an effect is added.
    """
    held = problem.fit_as_assumed(before, chosen)
    return replace(problem, widens=False), before if held is None else held


def _refined_scores(
    problem: FitProblem,
    baseline: Baseline,
    before: Fitted,
    scores: Sequence[ScreeningScore],
    chance: float,
    least: float,
) -> list[ScreeningScore]:
    """Closer looks, the best first; of one that explains bursts, chance is that of the bursts.

    Args:
        problem: the trials.
        baseline: the refitted model.
        before: its fit.
        scores: the looks so far.
        chance: that noise bursts so.
        least: chi-square that explains bursts.
    """
    refined = [
        refined_score(baseline, probed(problem, before, each.candidate), each) for each in scores
    ]
    refined = [
        replace(each, p_value=min(each.p_value, chance)) if each.gain >= least else each
        for each in refined
    ]
    return sorted(refined, key=lambda each: -each.gain)


def passes(problem: FitProblem, each: ScreeningScore, missing: bool = False) -> bool:
    """Whether chance, or arithmetic, would not show as much; chance may be ruled out already."""
    least = COARSE_CHANGE if problem.coarse else _least_change(problem)
    return (missing or each.p_value <= ALARM) and each.change >= least


def _least_change(problem: FitProblem) -> float:
    """Least rms of what an effect changes, over the noise."""
    in_pieces = len(set(problem.files)) < len(problem.trials)
    return PIECES_CHANGE if in_pieces else LEAST_CHANGE


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
    if gain < 30.0:
        return None
    if stage is not first and not carries_the_rest(stage.problem, stage.before, gain):
        least = min(first.fits.values(), key=cost)
        share = SURE_SHARE if stage.missing else SECOND_SHARE
        if gain < share * first.scale * (first.before.chi_square - least.chi_square):
            return None
    return name
