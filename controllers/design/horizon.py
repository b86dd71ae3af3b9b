"""Prediction horizon: its length, and the times at which errors count."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.metrics import SAMPLE_RATE_HZ

HORIZON_S, LONGEST = 0.32, 64
"""How far it looks ahead at least (s), and after how many periods that is enough anyway."""

DENSE = 4
"""Periods whose errors count at every scored sample."""

SPARSE_S = 0.01
"""Time between the errors that count after them (s), or a period if that is longer."""


class Horizon(NamedTuple):
    """The prediction horizon, by rows of a prediction.

    Attributes:
        parts: scored samples a period.
        blocks: which of the plan's voltages is in force in every period, shape (periods,).
        periods: period of every row, those of commands on their way counted before, shape (rows,).
        ends: when rows end, from where the plan is in force (periods / parts), shape (rows,).
        weights: root of how many samples a row's end stands for; 0 before the plan, shape (rows,).
    """

    parts: int
    blocks: NDArray[np.int64]
    periods: NDArray[np.int64]
    ends: NDArray[np.int64]
    weights: NDArray[np.float64]


def horizon(period: float, delay: int) -> Horizon:
    """The horizon of a control period (s) and an action delay (periods)."""
    parts = max(1, round(period * SAMPLE_RATE_HZ))
    lengths = block_lengths(period)
    coarse = max(1, min(parts, round(period / SPARSE_S)))
    counts = np.full(delay + sum(lengths), coarse)
    counts[:delay], counts[delay : delay + DENSE] = 1, parts
    periods = np.repeat(np.arange(len(counts)), counts)
    own = np.arange(len(periods)) - np.repeat(np.cumsum(counts) - counts, counts) + 1
    ends = (periods - delay) * parts + np.round(own * parts / counts[periods]).astype(int)
    samples = np.diff(ends, prepend=-delay * parts)
    weights = np.where(periods < delay, 0.0, np.sqrt(samples))
    blocks = np.repeat(np.arange(len(lengths)), lengths)
    return Horizon(parts, blocks, periods, ends, weights)


def block_lengths(period: float) -> list[int]:
    """For how many periods each voltage of a plan is held.

    >>> block_lengths(0.01)
    [1, 1, 2, 4, 8, 16]
    """
    lengths = [1, 1]
    while sum(lengths) * period < HORIZON_S - 1e-9 and sum(lengths) < LONGEST:
        lengths.append(2 * lengths[-1])
    return lengths
