"""Controllers against each other: who is better how often, by how much, and who may be ranked."""

from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.report.statistics import (
    CONFIDENCE,
    SMALLEST,
    Draws,
    Interval,
    interval,
    positive_interval,
)

_NO_SPREAD = 1e-12
"""Standard error below which a logarithm is the same in all resamples but for rounding."""


def improvement(first: NDArray[np.float64], second: NDArray[np.float64], draws: Draws) -> Interval:
    """Probability that the first controller's error is the smaller one in a case.

        P(A < B) + P(A = B) / 2

    Paired: both ran the very same case. So P(A, B) + P(B, A) = 1.

    Args:
        first: errors of A, shape (cases,).
        second: errors of B, shape (cases,).
        draws: the resamples.
    """
    # Whole halves: their sums are exact in any order.
    points = np.where(first < second, 1.0, np.where(first == second, 0.5, 0.0))
    shares = points[draws.cases].sum(axis=1) / len(points)
    return interval(points.mean(), shares, draws, (0.0, 1.0))


def ratio(
    estimates: tuple[float, float],
    replicates: tuple[NDArray[np.float64], NDArray[np.float64]],
    draws: Draws,
) -> Interval:
    """Ratio of two controllers' figures, each resample's over the other's of the same resample.

    What stations are drawn moves both alike, so the ratio is far surer than either figure.

    Args:
        estimates: figure of the first and of the second controller.
        replicates: their resamples, shape (replicates,) each.
        draws: the resamples.
    """
    (top, bottom), (above, below) = estimates, replicates
    drawn = np.maximum(above, SMALLEST) / np.maximum(below, SMALLEST)
    return positive_interval(max(top, SMALLEST) / max(bottom, SMALLEST), drawn, draws)


class Rank(NamedTuple):
    """Places that a controller may hold, the first is 1."""

    best: int
    worst: int

    def __str__(self) -> str:
        return str(self.best) if self.best == self.worst else f"{self.best}–{self.worst}"


@dataclass(frozen=True)
class Ranking:
    """Controllers ordered by significant differences of pairs.

    Attributes:
        ranks: of the controllers, in their order.
        separated: whether the row's controller is better than the column's, shape (n, n).
        critical: how many standard errors a difference must exceed, of all pairs at once.
    """

    ranks: tuple[Rank, ...]
    separated: NDArray[np.bool_]
    critical: float


def ranking(estimates: ArrayLike, replicates: NDArray[np.float64], draws: Draws) -> Ranking:
    """Ranks that hold together with 95 % confidence, however many controllers are compared.

    For every pair the logarithm of the ratio of their figures is compared with 0 by an interval of
    `critical` standard errors; `critical` is the 95 % point of the largest standardised difference
    among all pairs in the resamples (the max-t method), so that the chance of any false verdict is
    5 %. A controller's best possible rank is one more than the number that are surely better, its
    worst leaves only those that are surely worse behind it.

    Args:
        estimates: figure of every controller, the smaller the better.
        replicates: of the resamples, shape (controllers, replicates).
        draws: the resamples.
    Source:
        Mogstad, Romano, Shaikh and Wilhelm 2024, "Inference for Ranks" (Review of Economic Studies
        91), with the bootstrap of Romano and Wolf 2005 (Econometrica 73).
    """
    means = np.asarray(estimates, dtype=np.float64)
    number = len(means)
    separated = np.zeros((number, number), dtype=bool)
    pairs = list(combinations(range(number), 2))
    critical = np.nan
    if pairs and draws.known:
        middle = np.log(np.maximum(means, SMALLEST))
        drawn = np.log(np.maximum(replicates, SMALLEST))
        first, second = np.transpose(pairs)
        difference = middle[first] - middle[second]
        spread = drawn[first] - drawn[second] - difference[:, None]
        error = np.std(spread, axis=1)
        # A ratio that no resample changes needs no margin, and has no standardised difference.
        varies = error > _NO_SPREAD
        critical = _critical(spread[varies], error[varies])
        margin = np.where(varies, critical * draws.widening * error, _NO_SPREAD)
        beyond = np.abs(difference) > margin
        for (a, b), apart, gap in zip(pairs, beyond, difference, strict=True):
            separated[a, b], separated[b, a] = apart and gap < 0.0, apart and gap > 0.0
    ranks = tuple(
        Rank(1 + int(separated[:, i].sum()), number - int(separated[i].sum()))
        for i in range(number)
    )
    return Ranking(ranks, separated, critical)


def _critical(spread: NDArray[np.float64], error: NDArray[np.float64]) -> float:
    if not len(error):
        return 0.0
    largest = np.max(np.abs(spread) / error[:, None], axis=0)
    return float(np.quantile(largest, CONFIDENCE))
