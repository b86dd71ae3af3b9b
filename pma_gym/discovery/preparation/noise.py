"""The noise floor of each signal, and the filters that make that noise white.

Noise is seen where nothing moves: in rest segments, at constant commands long after the last
change, and between repeats of a trial. What an autoregression of the residual cannot predict is a
third estimate. The largest of what is seen at rest and the rounding of the readings counts: a
reading that stands still inside one step of the DAQ shows no noise at all. Of a signal that is read
a few times a trial, only repeats tell the noise, and no autoregression: its readings are seconds
apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from pma_gym.discovery.thresholds import (
    ENOUGH_FOR_NOISE,
    FIRST_REST_S,
    LEAST_REST,
    LEAST_SEGMENTS,
    MISS,
    MOVING_SPREAD,
    QUIETEST,
    REST_S,
    SLOW_S,
)
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

STUCK = 1e-9
"""Spread of readings that stand still, as a share of the largest: arithmetic's."""

USUAL, USUAL_SQUARE = 0.98, 0.8735
"""Share of differences that is noise for certain, and mean square of such a share of normal
numbers, the smallest."""

MOST_STEPS = 4e6
"""Most steps in a signal's span that are seen: an encoder of 50 nm over 0.2 m."""

LEAST_DISTINCT = 4
"""Fewest different readings that tell a step."""

MOST_ORDER = 6
"""Highest order of an autoregression."""


@dataclass(frozen=True)
class Whitening:
    """What makes one signal's noise white and of variance 1.

    Attributes:
        coefficients: a of r_t = a_1 r_(t-1) + ... + e_t, shape (order,).
        innovation: standard deviation of e (SI).
        level: standard deviation of r itself (SI).
        lines: frequencies (Hz) of lines beside it, of free amplitude and phase in every trial.
        drift: root mean square of a slow drift beside it, another in every trial (SI).
        waves: half waves that the drift has in a trial at least, as repeats tell.
    """

    coefficients: tuple[float, ...]
    innovation: float
    level: float
    lines: tuple[float, ...] = ()
    drift: float = 0.0
    waves: int = 0

    @property
    def has_nuisances(self) -> bool:
        """Whether there is anything beside it."""
        return bool(self.lines or self.drift)

    def white(self, series: Array, missing: NDArray[np.int64]) -> Array:
        """Whitened series, shape (..., rows); 0 where a reading is missing.

        A reading without a whole past counts by the level alone, as the first ones do.
        """
        white = series / self.innovation
        # Lag by lag: SciPy's filter without feedback goes through the series one by one.
        for lag, share in enumerate(self.coefficients, 1):
            white[..., lag:] -= (share / self.innovation) * series[..., :-lag]
        order = len(self.coefficients)
        white[..., :order] = series[..., :order] / self.level
        if missing.size:
            for lag in range(1, order + 1):
                alone = missing[missing < series.shape[-1] - lag] + lag
                white[..., alone] = series[..., alone] / self.level
            white[..., missing] = 0.0
        return white


def white_noise(level: float) -> Whitening:
    """The whitening of noise that is white already."""
    return Whitening((), level, level)


def rest_segments(logged: Logged) -> list[slice]:
    """Where a trial's commands have long been constant."""
    moved = (np.diff(logged.motor) != 0.0) | (np.diff(logged.regulator) != 0.0)
    edges = [0, *(np.flatnonzero(moved) + 1), len(logged.time)]
    segments = []
    for start, stop in zip(edges, edges[1:], strict=False):
        wait = FIRST_REST_S if start == 0 else REST_S
        first = int(np.searchsorted(logged.time, logged.time[start] + wait))
        if stop - first >= LEAST_REST:
            segments.append(slice(first, stop))
    return segments


def rest_readings(trials: Sequence[Logged], channel: int) -> list[Array]:
    """What a signal reads in rest segments, each less its straight line.

    A line, for what still creeps does so slowly.
    """
    stretches = []
    for logged in trials:
        if not logged.measures[channel]:
            continue
        for part in rest_segments(logged):
            values = logged.measured[channel, part].copy()
            values[np.isin(np.arange(part.start, part.stop), logged.missing[channel])] = np.nan
            known = np.isfinite(values)
            if known.sum() >= LEAST_REST:
                at = np.arange(len(values), dtype=float)
                line = np.polyfit(at[known], values[known], 1)
                stretches.append(values - np.polyval(line, at))
    return _quiet_segments(stretches)


def _quiet_segments(stretches: list[Array]) -> list[Array]:
    """Less those in which something moves: a rig that swings on while its drive is constant.

    They spread far more than the quieter half of the readings, and than neighbours do.
    """
    spreads = np.array([float(np.nanstd(part)) for part in stretches])
    # A sensor that stands still shows no noise.
    noisy = np.flatnonzero(spreads > STUCK * spreads.max(initial=0.0))
    if len(noisy) < LEAST_SEGMENTS:
        return stretches
    counts = np.array([int(np.isfinite(part).sum()) for part in stretches])
    order = noisy[np.argsort(spreads[noisy])]
    half = order[: 1 + int(np.searchsorted(np.cumsum(counts[order]), 0.5 * counts[order].sum()))]
    quiet = float(np.sqrt(np.average(spreads[half] ** 2, weights=counts[half])))
    # Were most of the readings in motion, their quieter half would be none.
    quiet = min(quiet, QUIETEST * float(spreads[order[0]]))
    most = MOVING_SPREAD * max(quiet, level_of_neighbours(stretches))
    return [part for part, spread in zip(stretches, spreads, strict=True) if spread <= most]


def level_at_rest(segments: Sequence[Array]) -> float | None:
    """Standard deviation of rest segments (SI), or None where there are too few readings."""
    count = sum(int(np.isfinite(part).sum()) for part in segments)
    if count < ENOUGH_FOR_NOISE:
        return None
    squares = sum(float(np.nansum(part**2)) for part in segments)
    return float(np.sqrt(squares / (count - 2 * len(segments))))


def level_of_neighbours(parts: Sequence[Array]) -> float:
    """Standard deviation of what neighbouring readings do not share (SI); 0 where it shows none.

    Of the third differences of readings, which a smooth motion hardly moves, without the largest:
    those are jumps of the motion, and outliers. What is slow or coloured in the noise shows less.

    Args:
        parts: a signal in each trial (SI), NaN where it was not read.
    """
    bends = np.concatenate([np.diff(part, 3) for part in parts] or [np.empty(0)])
    bends = bends[np.isfinite(bends)]
    if bends.size < ENOUGH_FOR_NOISE:
        return 0.0
    squares = np.sort(bends**2)[: int(USUAL * bends.size)]
    # 1, 3, 3, 1: the sum of squares is 20.
    return float(np.sqrt(np.mean(squares) / USUAL_SQUARE / 20.0))


def autoregression(parts: Sequence[Array], level: float) -> Whitening:
    """An autoregression of a signal's noise by Yule and Walker, its order by Schwarz's criterion.

    Args:
        parts: pieces of noise (SI), NaN where there is none.
        level: standard deviation that is known otherwise (SI): the noise is taken to be at least
            that.
    """
    lags = np.zeros(MOST_ORDER + 1)
    count = 0
    for part in parts:
        series = np.where(np.isfinite(part), part, 0.0)
        count += int(np.isfinite(part).sum())
        for lag in range(min(MOST_ORDER + 1, len(series))):
            lags[lag] += series[: len(series) - lag] @ series[lag:]
    if count < ENOUGH_FOR_NOISE or lags[0] <= 0.0:
        return white_noise(level)
    if sparse(parts):
        return white_noise(max(level, float(np.sqrt(lags[0] / count))))
    best, least = white_noise(max(level, float(np.sqrt(lags[0] / count)))), count * np.log(lags[0])
    for order in range(1, MOST_ORDER + 1):
        coefficients = solve_toeplitz(lags[:order], lags[1 : order + 1])
        left = lags[0] - coefficients @ lags[1 : order + 1]
        if left <= 0.0:
            break
        criterion = count * np.log(left) + order * np.log(count)
        if criterion < least:
            least = criterion
            share = np.sqrt(left / lags[0])
            best = Whitening(tuple(map(float, coefficients)), float(share * best.level), best.level)
    return best


def sparse(parts: Sequence[Array]) -> bool:
    """Whether a signal is read too seldom to be taken for a series.

    Args:
        parts: its readings or residuals in each trial, NaN where there is none.
    """
    counts = [int(np.isfinite(part).sum()) for part in parts]
    return not counts or max(counts) < LEAST_REST


def distinct_readings(trials: Sequence[Logged], channel: int) -> Array:
    """Readings of a signal (SI) that differ from each other, in order."""
    values = [
        np.delete(logged.measured[channel], logged.missing[channel])
        for logged in trials
        if logged.measures[channel]
    ]
    return np.unique(np.concatenate(values)) if values else np.empty(0)


def step_between(trials: Sequence[Logged], channel: int) -> float:
    """Smallest step between readings (SI), where they keep to whole steps; else 0."""
    distinct = distinct_readings(trials, channel)
    if len(distinct) < LEAST_DISTINCT:
        return 0.0
    gaps = np.diff(distinct)
    span = float(distinct[-1] - distinct[0])
    gaps = gaps[gaps > span / MOST_STEPS]
    step = float(np.min(gaps, initial=span))
    # The smallest gap is off by what a file rounds, and over many steps that would add up: ever
    # wider gaps tell the step ever better.
    for most in np.geomspace(8.0 * step, span, max(2, int(np.log(span / step)))):
        near = gaps[gaps <= most]
        step = float(near.sum() / np.round(near / step).sum())
    whole = (distinct - distinct[0]) / step
    miss = np.abs(whole - np.round(whole))
    # Readings in files are rounded to some digits: a hundredth of a step may be lost.
    return step if float(np.max(miss)) < MISS else 0.0


def slow_part(parts: Sequence[Array], rate_hz: float, level: float = 0.0) -> float:
    """Mean square of what is slow in a residual (SI squared), whatever its noise.

    The autocovariance over `SLOW_S`: sensors' noise has forgotten itself by then, and what a wrong
    model leaves has not. Of a signal that is read seldom, all that is more than noise.

    Args:
        parts: the residual in each trial (SI), NaN where there is none.
        rate_hz: rows a second (Hz).
        level: standard deviation of the noise (SI).
    """
    if sparse(parts):
        readings = np.concatenate([part[np.isfinite(part)] for part in parts] or [np.empty(0)])
        return max(0.0, float(np.mean(readings**2)) - level**2) if readings.size else 0.0
    first, last = (max(1, round(lag * rate_hz)) for lag in SLOW_S)
    sums, count = 0.0, 0
    for part in parts:
        for lag in range(first, last + 1):
            if lag < len(part):
                both = part[: len(part) - lag] * part[lag:]
                sums += float(np.nansum(both))
                count += int(np.isfinite(both).sum())
    return max(0.0, sums / count) if count else 0.0
