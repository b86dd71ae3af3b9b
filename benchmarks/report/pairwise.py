"""Controllers against each other: who is better how often, by how much, and who may be ranked."""

from dataclasses import dataclass
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
        ratios: figure of the row's controller over that of the column's, with the interval that
            holds for all pairs at once, shape (n, n).
        separated: whether the row's controller is better than the column's: its interval lies
            below 1, shape (n, n).
    """

    ranks: tuple[Rank, ...]
    ratios: tuple[tuple[Interval, ...], ...]
    separated: NDArray[np.bool_]


def ranking(estimates: ArrayLike, replicates: NDArray[np.float64], draws: Draws) -> Ranking:
    """Ranks and pairwise intervals that hold together with 95 % confidence.

    Every pair has one interval of the ratio of their figures, and differs where 1 lies outside.
    Each side of it is `critical` standard errors of the logarithm long, by the deviations on that
    side alone, for errors are skew. `critical` is the 95 % point of the largest standardised
    deviation among all pairs in the resamples (the max-t method), so that the chance of any false
    verdict is 5 %, however many controllers are compared. A controller's best possible rank is one
    more than the number that are surely better, its worst leaves only those that are surely worse
    behind it.

    Args:
        estimates: figure of every controller, the smaller the better.
        replicates: of the resamples, shape (controllers, replicates).
        draws: the resamples.
    Source:
        Mogstad, Romano, Shaikh and Wilhelm 2024, "Inference for Ranks" (Review of Economic Studies
        91), with the bootstrap of Romano and Wolf 2005 (Econometrica 73).
    """
    means = np.log(np.maximum(np.asarray(estimates, dtype=np.float64), SMALLEST))
    drawn = np.log(np.maximum(replicates, SMALLEST))
    number = len(means)
    middle = means[:, None] - means
    first, second = np.triu_indices(number, 1)
    deviation = drawn[first] - drawn[second] - middle[first, second][:, None]
    sides = np.stack([np.maximum(-deviation, 0.0), np.maximum(deviation, 0.0)])
    error = np.sqrt(2.0 * np.mean(sides**2, axis=-1))
    reach = np.full((2, number, number), 0.0 if draws.known else np.nan)
    reach[:, first, second] = _critical(sides, error) * draws.widening * error
    reach[:, second, first] = reach[::-1, first, second]
    low, high = middle - reach[0], middle + reach[1]
    separated = high < -_NO_SPREAD
    ranks = tuple(
        Rank(1 + int(separated[:, i].sum()), number - int(separated[i].sum()))
        for i in range(number)
    )
    ends = np.exp(np.stack([middle, low, high], axis=-1)).tolist()
    return Ranking(ranks, tuple(tuple(Interval(*pair) for pair in row) for row in ends), separated)


def _critical(sides: NDArray[np.float64], error: NDArray[np.float64]) -> float:
    """How many standard errors hold all deviations at once; shapes (2, pairs[, replicates])."""
    # A ratio that no resample changes needs no margin, and has no standardised difference.
    varies = error > _NO_SPREAD
    if not varies.any():
        return 0.0
    largest = np.max(sides[varies] / error[varies][:, None], axis=0)
    return float(np.quantile(largest, CONFIDENCE))
