"""Statistics over many cases: robust means and their intervals.

Errors come as an array: a row a controller, a column a case, so that everything is paired. How
sure a figure is comes from resampling what was drawn at random, the stations (or, on one station,
the seeds of its noise), within the strata of the suite, its tasks at a pressure or with a
reference; every controller gets the same draws. Source of the figures: Agarwal, Schwarzer, Castro,
Courville and Bellemare 2021, "Deep Reinforcement Learning at the Edge of the Statistical Precipice"
(NeurIPS 34), who pool runs and tasks in the same way.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t, trim_mean

REPLICATES = 2000
"""Resamples behind every interval."""

SEED = 2008
"""Seed of the resamples."""

CONFIDENCE = 0.95
"""How often an interval holds the true value."""

TRIMMED_SHARE = 0.25
"""Share of the cases that the interquartile mean leaves out at each end."""

WORST_SHARE = 0.1
"""Share of the cases that the conditional value at risk averages: the worst tenth."""

SMALLEST = 1e-300
"""What stands for an error of 0 where its logarithm is needed."""

_TAILS = (0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE))

Statistic = Callable[[NDArray[np.float64]], Any]
"""Figure of the cases along the last axis."""


class Interval(NamedTuple):
    """A figure and how sure it is.

    Attributes:
        estimate: of all cases.
        low: lower end of its 95 % interval; NaN where nothing tells it.
        high: upper end.
    """

    estimate: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Half the interval's width as a share of the estimate."""
        return 0.5 * (self.high - self.low) / self.estimate


def interquartile_mean(values: NDArray[np.float64]) -> Any:  # noqa: ANN401
    """Mean of the middle half: a quarter, rounded down, is left out at each end.

    As little shaken by a few outlying cases as the median, and far more precise.
    """
    return trim_mean(values, TRIMMED_SHARE, axis=-1)


def median(values: NDArray[np.float64]) -> Any:  # noqa: ANN401
    """The middle case."""
    return np.median(values, axis=-1)


def worst_tenth(values: NDArray[np.float64]) -> Any:  # noqa: ANN401
    """Conditional value at risk at 10 %: mean of the worst tenth of the cases, rounded up."""
    count = values.shape[-1]
    kept = max(1, -int(-WORST_SHARE * count // 1))
    return np.partition(values, count - kept, axis=-1)[..., count - kept :].mean(axis=-1)


@dataclass(frozen=True)
class Draws:
    """Resamples of the cases.

    Attributes:
        cases: numbers of the cases drawn, shape (replicates, cases).
        widening: by how much intervals are widened: a group of n units, resampled, spreads only
            (n - 1) / n of its variance, and few units have Student's distribution (Hesterberg
            2015, "What Teachers Should Know About the Bootstrap", American Statistician 69: the
            expanded percentile interval).
        known: whether every unit had another to be exchanged with; else no interval is honest.
    """

    cases: NDArray[np.int64]
    widening: float
    known: bool

    @property
    def counts(self) -> NDArray[np.int64]:
        """Count how often each case is drawn, shape (replicates, cases)."""
        rows, number = self.cases.shape
        at = self.cases + number * np.arange(rows)[:, None]
        return np.bincount(at.ravel(), minlength=rows * number).reshape(rows, number)


def resample(
    levels: Sequence[NDArray[np.int64]],
    units: NDArray[np.int64],
    replicates: int = REPLICATES,
    seed: int = SEED,
) -> Draws:
    """Draw units with replacement, each with all of its cases, from those with like cases.

    A station that ran several cases is drawn with all of them, for they are no independent
    witnesses. It is exchanged for stations with cases in the same strata, so that every stratum
    keeps its number of cases. A unit with no like is exchanged for one that is like it on the next,
    coarser level, at last for any with as many cases. Where one is left alone even so, all are
    exchanged on the coarser level.

    Args:
        levels: stratum of every case, shape (cases,) each, from fine to coarse.
        units: what was drawn at random: station or seed of every case, shape (cases,).
        replicates: how many resamples.
        seed: of the draws.
    """
    generator = np.random.default_rng(seed)
    drawn, spread = [], 0.0
    groups = _groups(levels, units)
    while min(map(len, groups)) == 1 and levels:
        levels = levels[1:]
        groups = _groups(levels, units)
    for table in groups:
        members = generator.integers(len(table), size=(replicates, len(table)))
        drawn.append(table[members].reshape(replicates, -1))
        spread += table.size * (len(table) - 1) / len(table)
    known = min(map(len, groups)) > 1
    freedom = sum(len(table) - 1 for table in groups)
    widening = (len(units) / spread) ** 0.5 * _student(freedom) if known else np.nan
    return Draws(np.concatenate(drawn, axis=1), widening, known)


def _student(freedom: int) -> float:
    """How much wider Student's distribution is than the normal one at the interval's ends."""
    end = 0.5 * (1.0 + CONFIDENCE)
    return float(t.ppf(end, freedom) / norm.ppf(end))


def _groups(levels: Sequence[NDArray[np.int64]], units: NDArray[np.int64]) -> list[NDArray]:
    """Units that may stand for each other: tables of their cases, shape (units, cases each)."""
    left = {int(unit): np.flatnonzero(units == unit) for unit in np.unique(units)}
    groups = []
    for depth, level in enumerate([*levels, np.zeros_like(units)]):
        alike: dict[tuple[int, ...], list[int]] = {}
        for unit, cases in left.items():
            alike.setdefault(tuple(sorted(level[cases].tolist())), []).append(unit)
        for members in alike.values():
            if len(members) > 1 or depth == len(levels):
                # By stratum, so that a column holds what is like.
                cases = [left.pop(unit) for unit in members]
                groups.append(np.stack([c[np.argsort(level[c], kind="stable")] for c in cases]))
    return groups


def replicated(
    values: NDArray[np.float64], draws: Draws, statistic: Statistic
) -> NDArray[np.float64]:
    """A figure of every resample.

    Args:
        values: a row a controller, a column a case.
        draws: the resamples.
        statistic: the figure.
    Returns:
        Shape (controllers, replicates).
    """
    return np.stack([statistic(row[draws.cases]) for row in values])


def interval(
    estimate: float,
    replicates: NDArray[np.float64],
    draws: Draws,
    bounds: tuple[float, float] = (-np.inf, np.inf),
) -> Interval:
    """The percentile interval of a figure from its resamples, held within what it can be."""
    if not draws.known:
        return Interval(float(estimate), np.nan, np.nan)
    ends = estimate + draws.widening * (np.quantile(replicates, _TAILS) - estimate)
    low, high = np.clip(ends, *bounds)
    return Interval(float(estimate), float(low), float(high))


def positive_interval(estimate: float, replicates: NDArray[np.float64], draws: Draws) -> Interval:
    """The same of a figure above 0, such as an error or a ratio: widened as a factor."""
    middle = np.log(max(estimate, SMALLEST))
    logarithmic = interval(middle, np.log(np.maximum(replicates, SMALLEST)), draws)
    return Interval(
        float(estimate), float(np.exp(logarithmic.low)), float(np.exp(logarithmic.high))
    )


def profile(
    errors: NDArray[np.float64], thresholds: NDArray[np.float64], draws: Draws
) -> NDArray[np.float64]:
    """Performance profile of a controller: share of the cases with an error up to a threshold.

    Args:
        errors: of the cases, shape (cases,).
        thresholds: shape (n,).
        draws: the resamples.
    Returns:
        Share, lower and upper end of its pointwise interval, shape (3, n).
    """
    order = np.argsort(errors, kind="stable")
    reached = np.searchsorted(errors[order], thresholds, side="right")
    shares = _shares(draws.counts[:, order], reached)
    share = reached / len(errors)
    ends = [interval(s, r, draws, (0.0, 1.0))[1:] for s, r in zip(share, shares.T, strict=True)]
    return np.vstack([share, np.transpose(ends)])


def _shares(counts: NDArray[np.int64], reached: NDArray[np.int64]) -> NDArray[np.float64]:
    """Share of every resample's cases among the first so many, shape (replicates, n)."""
    summed = np.cumsum(counts, axis=1)
    return np.concatenate([np.zeros((len(counts), 1)), summed], axis=1)[:, reached] / summed[:, -1:]
