"""Readings that a fit has not seen: how far it is from them.

Whole trials are left out. Of one long trial, stretches of time are: it is simulated from its
beginning, so that what the rig remembers goes on through them, but their readings take no part.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.fits import Bench, Fitted
from pma_gym.discovery.predicting import Whole
from pma_gym.discovery.suspects import Suspect

Array = NDArray[np.float64]

FOLDS = 6
"""Parts that trials are divided into; each is left out once."""

LONG_S = 20.0
"""A single trial of this length (s) or more has stretches that can be left out."""

STRETCH_S = 5.0
"""About how long such a stretch is (s): longer than what the rig remembers of before."""


@dataclass(frozen=True)
class Unseen:
    """What a model says of readings that it was not fitted to.

    Attributes:
        readings: what its sensors hold (SI), shape (4, rows) for each trial.
        chi_square: of the whitened residuals of each trial, shape (trials,).
        surprise: the same of each fold, given how well the others hold the parameters
            (`predicting.Whole.surprise`), shape (folds,); empty if that was not asked for.
    """

    readings: list[Array]
    chi_square: Array
    surprise: Array


def folds(count: int, files: Sequence[str] = ()) -> list[list[int]]:
    """Trials by fold, so that neighbours in order fall into different ones.

    Pieces of one file tell of each other, so whole files are left out, or contiguous blocks where
    there is one file only.

    Args:
        count: of trials.
        files: the file that each is a piece of; empty where each is a file of its own.
    """
    names = list(dict.fromkeys(files))
    if not names or len(names) == count:
        return [list(range(k, count, FOLDS)) for k in range(min(FOLDS, count))]
    if len(names) == 1:
        parts = np.array_split(np.arange(count), min(FOLDS, count))
        return [part.tolist() for part in parts]
    place = {name: k % FOLDS for k, name in enumerate(names)}
    return [
        [i for i, file in enumerate(files) if place[file] == fold]
        for fold in range(min(FOLDS, len(names)))
    ]


def fold_of_rows(trials: Sequence[Trial], files: Sequence[str] = ()) -> list[NDArray[np.int64]]:
    """The fold that each row of each trial is left out with, shape (rows,) for each trial."""
    if len(trials) == 1:
        number = np.zeros(len(trials[0]), np.int64)
        for fold, rows in enumerate(stretches(trials)):
            number[rows] = fold
        return [number]
    fold_of = {i: k for k, part in enumerate(folds(len(trials), files)) for i in part}
    return [np.full(len(trial), fold_of[i]) for i, trial in enumerate(trials)]


def stretches(trials: Sequence[Trial]) -> list[NDArray[np.bool_]]:
    """Of one long trial, the rows of each fold; nothing for several trials, or a short one."""
    if len(trials) != 1 or trials[0].duration < LONG_S:
        return []
    time = trials[0].time
    count = FOLDS * max(1, round(trials[0].duration / (FOLDS * STRETCH_S)))
    number = ((time - time[0]) * (count / (time[-1] - time[0]) * (1.0 - 1e-12))).astype(int)
    return [number % FOLDS == fold for fold in range(FOLDS)]


def unseen(
    bench: Bench,
    fit: Fitted,
    chosen: Sequence[Suspect],
    progress: Callable[[int, int], None] | None = None,
    judged: bool = False,
) -> Unseen | None:
    """Leave each fold out once, fit the others from where the fit of all is, and look at it.

    Where nothing is free, nothing is fitted. None with a single trial that is not long, or where a
    fit fails.

    Args:
        bench: the trials.
        fit: of all of them.
        chosen: the suspects in it.
        progress: called with the number of folds that are done, and of all.
        judged: whether to find out how surprising folds are.
    """
    whole = Whole.of(bench, fit, chosen) if judged else None
    if len(bench.trials) < 2:
        return _unseen_stretches(bench, fit, chosen, progress, whole)
    count = len(bench.trials)
    readings: list[Array] = [np.empty(0)] * count
    chi_square, surprised = np.zeros(count), list[float]()
    parts, begun = folds(count, bench.files), fit.model if whole is None else whole.fit.model
    for number, left_out in enumerate(parts):
        if progress is not None:
            progress(number, len(parts))
        seen = [i for i in range(count) if i not in left_out]
        found = bench.fit(begun, chosen, trials=seen) if fit.paths else fit
        held = None if found is None else _look(bench, found, chosen, left_out)
        if found is None or held is None:
            return None
        if whole is not None:
            surprised.append(whole.surprise(bench.evidence(begun, chosen, seen), found))
        for k, i in enumerate(left_out):
            readings[i], chi_square[i] = held.readings[k], held.chi_square[k]
    return Unseen(readings, chi_square, np.array(surprised))


def _unseen_stretches(
    bench: Bench,
    fit: Fitted,
    chosen: Sequence[Suspect],
    progress: Callable[[int, int], None] | None,
    whole: Whole | None,
) -> Unseen | None:
    """The same for the stretches of a single trial; None where it has none."""
    parts = stretches(bench.trials)
    if not parts:
        return None
    (trial,) = bench.trials
    readings, chi_square = np.full((4, len(trial)), np.nan), 0.0
    surprised, begun = list[float](), fit.model if whole is None else whole.fit.model
    for number, left_out in enumerate(parts):
        if progress is not None:
            progress(number, len(parts))
        seen, rest = _masked(trial, left_out), _masked(trial, ~left_out)
        if not all(_measures(part) for part in (seen, rest)):
            return None
        part = replace(bench, trials=[seen])
        found = part.fit(begun, chosen) if fit.paths else fit
        held = None if found is None else _look(replace(bench, trials=[rest]), found, chosen, [0])
        if found is None or held is None:
            return None
        if whole is not None:
            surprised.append(whole.surprise(part.evidence(begun, chosen), found))
        readings[:, left_out] = held.readings[0][:, left_out]
        chi_square += float(held.chi_square[0])
    return Unseen([readings], np.array([chi_square]), np.array(surprised))


@dataclass(frozen=True)
class _Held:
    """As `Unseen`, of one fold: readings (SI) and chi-square of each of its trials."""

    readings: list[Array]
    chi_square: Array


def _look(
    bench: Bench, found: Fitted, chosen: Sequence[Suspect], left_out: Sequence[int]
) -> _Held | None:
    """Trials beside a fit; None where it cannot be simulated on them."""
    evidence = bench.evidence(found.model, chosen, left_out)
    pieces = evidence.pieces(found.values, np.empty(0))
    held = evidence.readings(found.values)
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
