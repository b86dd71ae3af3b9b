"""Trials that a fit has not seen: how far it is from them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fits import Bench, Fitted
from pma_gym.discovery.suspects import Suspect

Array = NDArray[np.float64]

FOLDS = 6
"""Parts that trials are divided into; each is left out once."""


@dataclass(frozen=True)
class Unseen:
    """What a model says of trials that it was not fitted to.

    Attributes:
        readings: what its sensors hold (SI), shape (4, rows) for each trial.
        chi_square: of the whitened residuals of each trial, shape (trials,).
    """

    readings: list[Array]
    chi_square: Array


def folds(count: int) -> list[list[int]]:
    """Trials by fold, so that neighbours in order fall into different ones."""
    return [list(range(k, count, FOLDS)) for k in range(min(FOLDS, count))]


def unseen(
    bench: Bench,
    fit: Fitted,
    chosen: Sequence[Suspect],
    progress: Callable[[int, int], None] | None = None,
) -> Unseen | None:
    """Leave each fold out once, fit the others from where the fit of all is, and look at it.

    None with fewer than two trials, or where a fit fails.
    """
    count = len(bench.trials)
    if count < 2:
        return None
    readings: list[Array] = [np.empty(0)] * count
    chi_square = np.zeros(count)
    parts = folds(count)
    for number, left_out in enumerate(parts):
        if progress is not None:
            progress(number, len(parts))
        seen = [i for i in range(count) if i not in left_out]
        found = bench.fit(fit.model, chosen, trials=seen)
        if found is None:
            return None
        evidence = bench.evidence(found.model, chosen, left_out)
        pieces = evidence.pieces(found.values, np.empty(0))
        held = evidence.readings(found.values)
        if pieces is None or held is None:
            return None
        for k, i in enumerate(left_out):
            readings[i] = held[k]
            chi_square[i] = pieces.total([k])[0, 0]
    return Unseen(readings, chi_square)
