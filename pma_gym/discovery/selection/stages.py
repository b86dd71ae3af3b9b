"""One round of the selection: candidates are scored beside the model; what passes is fitted.

The gate is the score test: chance explains as much, over the whole catalogue, in one of two hundred
data sets. It opens too where the residual itself is no noise: where it is many times as large
(`far_off`), where it is autocorrelated beyond the noise (`autocorrelation`), or where single pieces
are too large for noise (`scan_statistic`) and an effect explains them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.residuals import far_off, is_autocorrelated, scan_of_fit
from pma_gym.discovery.screening.scan_statistic import NO_EXCESS, ScanStatistic
from pma_gym.discovery.screening.score_test import ScreeningScore, screen
from pma_gym.discovery.screening.starting_points import refined_score
from pma_gym.discovery.selection.candidate_fits import fitted, probed, restarted, unfitted
from pma_gym.discovery.thresholds import (
    ALARM,
    BESIDE_DRIFT,
    BESIDE_STEPS,
    CARRIED,
    LEAST_CHANGE,
    TRIED,
    WORTH_A_FIT,
)

Progress = Callable[[str, int, int], None]


def fits_of_candidates(
    problem: FitProblem,
    baseline: Baseline,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    scores: Sequence[ScreeningScore],
    restarts: bool,
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
        restarts: whether fits that come near no trial are begun again.
        journal: keeps fits.
        progress: called with a step's name, what is done and the total.
    """
    fits: dict[str, Fitted] = {}
    worth = [each for each in scores if each.gain > WORTH_A_FIT * scores[0].gain and each.starts]
    for number, each in enumerate(worth[:TRIED]):
        progress(f"fitting effect {len(chosen) + 1}", number, len(worth[:TRIED]))
        refit = fitted(problem, baseline, before, chosen, each, journal)
        if refit is not None:
            fits[each.candidate.name] = refit
    beside, scored = (problem, baseline, before, chosen), dict(fits)
    if restarts:
        fits |= restarted(*beside, worth, scored, fits, journal, progress)
    return fits, unfitted(*beside, worth[:TRIED], fits)


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


def stage_of(
    problem: FitProblem,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    rest: Sequence[CandidateEffect],
    seed: int,
    journal: Journal,
    progress: Progress,
) -> Stage:
    """One round of candidates (`rest`) beside a model with some effects (`before`, `chosen`)."""
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
    fits: dict[str, Fitted] = {}
    unfitted: tuple[str, ...] = ()
    if gate:
        beside = problem, baseline, before, chosen
        fits, unfitted = fits_of_candidates(*beside, scores, not astray, journal, progress)
    gains = [before.chi_square - fit.chi_square for fit in fits.values()]
    if scan.excess and all(gain < least for gain in gains):
        gate, fits, scores, scan = (), {}, plainly, NO_EXCESS
    return Stage(
        shared,
        before,
        baseline,
        tuple(scores),
        fits,
        gate,
        missing,
        scan,
        unfitted,
    )


def _as_assumed(
    problem: FitProblem, before: Fitted, chosen: tuple[CandidateEffect, ...]
) -> tuple[FitProblem, Fitted]:
    """Trials and fit within what was assumed of the parameters.

    Parameters far from what was assumed hide what is missing. Looks and fits begin beside what was
    assumed of them, and stay there until an effect is added.
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
    least = BESIDE_STEPS if problem.coarse else _least_change(problem)
    return (missing or each.p_value <= ALARM) and each.change >= least


def _least_change(problem: FitProblem) -> float:
    """Least rms of what an effect changes, over the noise."""
    drifts = any(each.drift for each in problem.noise)
    return BESIDE_DRIFT if drifts else LEAST_CHANGE
