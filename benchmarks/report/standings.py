"""Standings of controllers in a measure: means with intervals, ranks, pairs.

Controllers against each other: who is better how often, by how much, and who may be ranked.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.report.errors import Errors, is_bound
from benchmarks.report.statistics import (
    CONFIDENCE,
    SMALLEST,
    Draws,
    Interval,
    Statistic,
    interquartile_mean,
    interval,
    median,
    positive_interval,
    replicated,
    worst_tenth,
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
    return float(np.quantile(np.max(sides[varies] / error[varies][:, None], axis=0), CONFIDENCE))


class Standing(NamedTuple):
    """A controller in a measure; all errors in the measure's unit.

    Attributes:
        name: of the controller.
        mean: interquartile mean.
        median: the middle case.
        worst: mean of the worst tenth of the cases (CVaR 10 %).
        percent: interquartile mean of the error in percent of its task's range.
        rank: places that it may hold; None for a bound.
        to_best: its interquartile mean over that of the best rival; of a rival with the interval
            that holds for all pairs at once, by which ranks are claimed.
        to_bound: over that of the bound; None if no bound ran.
        failures: how many of its cases failed.
    """

    name: str
    mean: Interval
    median: Interval
    worst: Interval
    percent: float
    rank: Rank | None
    to_best: Interval | None
    to_bound: Interval | None
    failures: int


class Pair(NamedTuple):
    """Two controllers in a measure.

    Attributes:
        first: name of the one.
        second: name of the other.
        improvement: probability that the first one's error is the smaller.
        ratio: interquartile mean of the first over that of the second; of two rivals with the
            interval that holds for all pairs at once.
        separated: whether the first is better beyond doubt: that interval lies below 1.
    """

    first: str
    second: str
    improvement: Interval
    ratio: Interval
    separated: bool


@dataclass(frozen=True)
class Standings:
    """All controllers in a measure.

    Attributes:
        errors: the errors that it is made from.
        failed: how many cases of each controller failed.
    """

    errors: Errors
    failed: tuple[int, ...]

    @property
    def draws(self) -> Draws:
        """The resamples, the same for every figure and controller."""
        return self.errors.draws

    @cached_property
    def means(self) -> NDArray[np.float64]:
        """Interquartile mean of every controller, shape (controllers,)."""
        return np.asarray(interquartile_mean(self.errors.values))

    @cached_property
    def _resampled(self) -> NDArray[np.float64]:
        return replicated(self.errors.values, self.draws, interquartile_mean)

    @cached_property
    def rivals(self) -> list[int]:
        """Numbers of the controllers that are no bounds."""
        return [at for at, name in enumerate(self.errors.names) if not is_bound(name)]

    @cached_property
    def ranking(self) -> Ranking:
        """Ranks of the rivals, in their order."""
        return ranking(self.means[self.rivals], self._resampled[self.rivals], self.draws)

    @property
    def best(self) -> int | None:
        """Number of the rival with the least interquartile mean; None if there is no rival."""
        return min(self.rivals, key=lambda at: self.means[at], default=None)

    @property
    def bound(self) -> int | None:
        """Number of the lowest bound; None if none ran."""
        bounds = set(range(len(self.errors.names))) - set(self.rivals)
        return min(bounds, key=lambda at: (self.means[at], at), default=None)

    def ratio(self, first: int, second: int) -> Interval:
        """Interquartile mean of one controller over another's, paired; of this pair alone."""
        estimates = float(self.means[first]), float(self.means[second])
        return ratio(estimates, (self._resampled[first], self._resampled[second]), self.draws)

    @cached_property
    def _places(self) -> dict[int, int]:
        """Places of the rivals in their ranking, by number."""
        return {at: place for place, at in enumerate(self.rivals)}

    def _joint_ratio(self, first: int, second: int) -> tuple[Interval, bool]:
        """The ratio that ranks are claimed by, and whether the first is better beyond doubt."""
        places = self._places
        if first not in places or second not in places:
            alone = self.ratio(first, second)
            return alone, alone.high < 1.0
        row, column = places[first], places[second]
        return self.ranking.ratios[row][column], bool(self.ranking.separated[row, column])

    def pair(self, first: int, second: int) -> Pair:
        """One controller against another, by their numbers."""
        names, values = self.errors.names, self.errors.values
        wins = improvement(values[first], values[second], self.draws)
        return Pair(names[first], names[second], wins, *self._joint_ratio(first, second))

    def _interval(self, at: int, statistic: Statistic) -> Interval:
        values = self.errors.values[at : at + 1]
        if statistic is interquartile_mean:
            drawn = self._resampled[at]
        else:
            drawn = replicated(values, self.draws, statistic)[0]
        return positive_interval(float(statistic(values)[0]), drawn, self.draws)

    @cached_property
    def rows(self) -> list[Standing]:
        """Rivals from the least interquartile mean to the largest, then the bounds."""
        order = sorted(
            range(len(self.errors.names)),
            key=lambda at: (at not in self.rivals, self.means[at], at),
        )
        return [self._standing(at) for at in order]

    def _standing(self, at: int) -> Standing:
        measure, best, bound = self.errors.measure, self.best, self.bound
        scales = np.array([measure.percent(e.task) for e in self.errors.episodes])
        return Standing(
            name=self.errors.names[at],
            mean=self._interval(at, interquartile_mean),
            median=self._interval(at, median),
            worst=self._interval(at, worst_tenth),
            percent=float(interquartile_mean(self.errors.values[at] * scales)),
            rank=self.ranking.ranks[self._places[at]] if at in self._places else None,
            to_best=None if best is None else self._joint_ratio(at, best)[0],
            to_bound=None if bound is None else self.ratio(at, bound),
            failures=self.failed[at],
        )

    @cached_property
    def pairs(self) -> list[Pair]:
        """Every controller against every other, rivals and bounds."""
        return [self.pair(*two) for two in permutations(range(len(self.errors.names)), 2)]
