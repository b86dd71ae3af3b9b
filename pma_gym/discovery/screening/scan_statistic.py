"""Scan the residual for pieces that are too large to be noise.

What shows at a few instants only, such as a cable that comes taut, weighs little in a whole record:
a sign-flipping test has few pieces to flip, and the residual is hardly autocorrelated. Yet in a
piece of a quarter of a second it may be far beyond the sensor's noise. The test needs no
candidate.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh, toeplitz
from scipy.stats import binom

from pma_gym.discovery.preparation.noise import Whitening, autoregression, sparse, white_noise
from pma_gym.discovery.thresholds import (
    ENOUGH_FOR_NOISE,
    LEAST_REST,
    OUTLIER,
    OUTLIERS_CHANCE,
    SCAN_CHANCE,
)

Array = NDArray[np.float64]

HALVINGS = 60
"""Of an interval, in search of where a bound is least."""


@dataclass(frozen=True)
class ScanStatistic:
    """Pieces of one signal's residual that noise does not make.

    Attributes:
        chance: that noise makes the least likely piece, over all of them; an upper bound.
        excess: chi-square of all such pieces, by the level that was given, beyond what noise has;
            0 without any.
    """

    chance: float
    excess: float


NO_EXCESS = ScanStatistic(1.0, 0.0)


def scan_statistic(
    parts: Sequence[Array], edges: Sequence[Sequence[int]], level: float, step: float
) -> ScanStatistic:
    """Scan the residual of one signal for pieces that noise does not make.

    Args:
        parts: the residual in each trial (SI), NaN where there is none.
        edges: where the pieces of each trial begin, and its end.
        level: standard deviation of the noise, as rest or the sensor tells it (SI).
        step: between readings (SI): rounding moves one by half of it at most, and noise need not
            do what rounding can.
    """
    if sparse(parts) or sum(int(np.isfinite(part).sum()) for part in parts) < ENOUGH_FOR_NOISE:
        return NO_EXCESS
    pieces = [
        piece[np.isfinite(piece)]
        for part, at in zip(parts, edges, strict=True)
        for piece in np.split(part, at[1:-1])
    ]
    pieces = [piece for piece in pieces if len(piece) >= LEAST_REST]
    if len(pieces) <= 1:
        return NO_EXCESS
    noise = noise_of(parts, level)
    beyond = [np.maximum(np.abs(piece) - 0.5 * step, 0.0) / noise.level for piece in pieces]
    colour = autocorrelation(noise, max(map(len, pieces)))
    weights: dict[int, Array] = {}
    least, excess = 1.0, 0.0
    for k in np.flatnonzero(_together(beyond)):
        size = len(beyond[k])
        if size not in weights:
            weights[size] = eigvalsh(toeplitz(colour[:size]))
        # Less the largest: one outlier is no structure.
        power = float(beyond[k] @ beyond[k] - np.max(beyond[k]) ** 2)
        chance = tail(power, weights[size]) * len(pieces)
        least = min(least, chance)
        if chance <= SCAN_CHANCE:
            excess += float(pieces[k] @ pieces[k] - size * noise.level**2) / level**2
    return ScanStatistic(least, excess)


def noise_of(parts: Sequence[Array], level: float) -> Whitening:
    """Level and colour of the noise in a residual, hardly moved by pieces that are beyond it.

    Args:
        parts: the residual in each trial (SI), NaN where there is none.
        level: standard deviation as it is known otherwise (SI): the noise is taken to be at least
            that.
    """
    noise = white_noise(level)
    for _ in range(2):
        # Outliers are cut: of noise that costs a thousandth of its level.
        most = OUTLIER * noise.level
        noise = autoregression([np.clip(part, -most, most) for part in parts], noise.level)
    return noise


def _together(beyond: Sequence[Array]) -> NDArray[np.bool_]:
    """Pieces in which more outliers lie than come together by chance, by all the others."""
    outliers = np.array([np.count_nonzero(piece > OUTLIER) for piece in beyond])
    sizes = np.array([len(piece) for piece in beyond])
    rate = (outliers.sum() - outliers + 1.0) / (sizes.sum() - sizes + 1.0)
    return binom.sf(outliers - 1, sizes, rate) * len(beyond) <= OUTLIERS_CHANCE


def autocorrelation(noise: Whitening, count: int) -> Array:
    """Autocorrelation of an autoregression at lags from 0, shape (count,).

    >>> autocorrelation(Whitening((0.5,), 1.0, 1.0), 4).tolist()
    [1.0, 0.5, 0.25, 0.125]
    """
    order = len(noise.coefficients)
    sums = np.zeros(max(count, order + 1))
    sums[0] = 1.0
    # Yule and Walker's equations, for the lags up to the order.
    across, along = np.eye(order), np.zeros(order)
    for row in range(order):
        for k, weight in enumerate(noise.coefficients):
            apart = abs(row - k)
            if apart:
                across[row, apart - 1] -= weight
            else:
                along[row] += weight
    sums[1 : order + 1] = np.linalg.solve(across, along)
    for lag in range(order + 1, count):
        sums[lag] = np.dot(noise.coefficients, sums[lag - order : lag][::-1])
    return sums[:count]


def tail(power: float, weights: Array) -> float:
    """Chernoff's bound on the chance that squares of normal numbers, weighted, sum to so much.

    >>> from scipy.stats import chi2
    >>> bool(1.0 < tail(100.0, np.ones(32)) / chi2.sf(100.0, 32) < 30.0)
    True
    """
    if power <= float(weights.sum()):
        return 1.0
    low, high = 0.0, 0.5 / float(weights.max())
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if float(np.sum(weights / (1.0 - 2.0 * middle * weights))) < power:
            low = middle
        else:
            high = middle
    logarithm = low * power + 0.5 * float(np.sum(np.log1p(-2.0 * low * weights)))
    return float(np.exp(-logarithm))
