"""Which readings are left out together: whole trials, files, or blocks of one long trial."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.thresholds import FOLDS, LONG_S, STRETCH_S


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
