"""Readings that a fit has not seen: how far it is from them.

Whole trials are left out. Of one long trial, stretches of time are: it is simulated from its
beginning, so that hysteresis and creep go on through them, but their readings take no part.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.predictive_density import PredictiveDensity
from pma_gym.discovery.preparation.splits import folds, stretches
from pma_gym.discovery.thresholds import MAJORITY

Array = NDArray[np.float64]

Fit = tuple[Fitted, Sequence[CandidateEffect]]
"""A fit of all trials, and the candidates in it."""


@dataclass(frozen=True)
class HeldOutMisfit:
    """What a model says of readings that it was not fitted to.

    Attributes:
        readings: what its sensors hold (SI), shape (signals, rows) for each trial.
        chi_square: of the whitened residuals of each trial, shape (trials,).
        deviance: the same of each fold, given how well the others hold the parameters
            (`PredictiveDensity.deviance`), shape (folds,); empty if that was not asked for.
    """

    readings: list[Array]
    chi_square: Array
    deviance: Array


def held_out_misfit(
    problem: FitProblem,
    fit: Fitted,
    chosen: Sequence[CandidateEffect],
    progress: Callable[[int, int], None] | None = None,
    judged: bool = False,
) -> HeldOutMisfit | None:
    """Leave each fold out once, fit the others from where the fit of all is, and look at it.

    Where nothing is free, nothing is fitted. None with a single trial that is not long, or where a
    fit fails.

    Args:
        problem: the trials.
        fit: of all of them.
        chosen: the candidates in it.
        progress: called with the number of folds that are done, and of all.
        judged: whether to find out how surprising folds are.
    """
    whole = PredictiveDensity.of(problem, fit, chosen) if judged else None
    if len(problem.trials) <= 1:
        return _unseen_stretches(problem, fit, chosen, progress, whole)
    count = len(problem.trials)
    readings: list[Array] = [np.empty(0)] * count
    chi_square, deviances = np.zeros(count), list[float]()
    parts, begun = folds(count, problem.files), fit.model if whole is None else whole.fit.model
    for number, left_out in enumerate(parts):
        if progress is not None:
            progress(number, len(parts))
        seen = [i for i in range(count) if i not in left_out]
        refit = problem.fit(begun, chosen, trials=seen) if fit.paths else fit
        held = None if refit is None else _held_out_of(problem, refit, chosen, left_out)
        if refit is None or held is None:
            return None
        if whole is not None:
            deviances.append(whole.deviance(problem.whitened_residuals(begun, chosen, seen), refit))
        for k, i in enumerate(left_out):
            readings[i], chi_square[i] = held.readings[k], held.chi_square[k]
    return HeldOutMisfit(readings, chi_square, np.array(deviances))


def is_asked_for(problem: FitProblem, whole: Fit, simpler: Fit) -> bool:
    """Whether most trials ask for a whole law when left out; yes where none can be left out.

    They are counted, not added up: one trial that a fit of the others runs away in outweighs all.

    Args:
        problem: the trials.
        whole: the fit with the whole law, and the candidates in it.
        simpler: the same with a simpler one.
    """
    theirs, others = (held_out_misfit(problem, *each) for each in (whole, simpler))
    if theirs is None or others is None:
        return True
    return bool(np.mean(theirs.chi_square < others.chi_square) > MAJORITY)


def _unseen_stretches(
    problem: FitProblem,
    fit: Fitted,
    chosen: Sequence[CandidateEffect],
    progress: Callable[[int, int], None] | None,
    whole: PredictiveDensity | None,
) -> HeldOutMisfit | None:
    """The same for the stretches of a single trial; None where it has none."""
    parts = stretches(problem.trials)
    if not parts:
        return None
    (trial,) = problem.trials
    readings, chi_square = np.full((4, len(trial)), np.nan), 0.0
    deviances, begun = list[float](), fit.model if whole is None else whole.fit.model
    for number, left_out in enumerate(parts):
        if progress is not None:
            progress(number, len(parts))
        seen, rest = _masked(trial, left_out), _masked(trial, ~left_out)
        if not all(_measures(part) for part in (seen, rest)):
            return None
        part = replace(problem, trials=[seen])
        refit = part.fit(begun, chosen) if fit.paths else fit
        held = (
            None
            if refit is None
            else _held_out_of(replace(problem, trials=[rest]), refit, chosen, [0])
        )
        if refit is None or held is None:
            return None
        if whole is not None:
            deviances.append(whole.deviance(part.whitened_residuals(begun, chosen), refit))
        readings[:, left_out] = held.readings[0][:, left_out]
        chi_square += float(held.chi_square[0])
    return HeldOutMisfit([readings], np.array([chi_square]), np.array(deviances))


@dataclass(frozen=True)
class _Held:
    """As `HeldOutMisfit`, of one fold: readings (SI) and chi-square of each of its trials."""

    readings: list[Array]
    chi_square: Array


def _held_out_of(
    problem: FitProblem, refit: Fitted, chosen: Sequence[CandidateEffect], left_out: Sequence[int]
) -> _Held | None:
    """Trials beside a fit; None where it cannot be simulated on them."""
    whitened = problem.whitened_residuals(refit.model, chosen, left_out)
    pieces = whitened.pieces(refit.values, np.empty(0))
    held = whitened.readings(refit.values)
    if pieces is None or held is None:
        return None
    count = range(len(left_out))
    return _Held(held, np.array([pieces.total([k])[0, 0] for k in count]))


def _masked(trial: Trial, left_out: NDArray[np.bool_]) -> Trial:
    """A trial whose readings in some rows do not count."""
    kept = {name: np.where(left_out, np.nan, row) for name, row in trial.measurements.items()}
    return replace(trial, measurements=kept)


def _measures(trial: Trial) -> bool:
    return any(np.isfinite(row).any() for row in trial.measurements.values())
