"""Colour and drift of the noise, learnt where nothing but noise differs: repeats, and rest.

What repeats with the command is structure; only what does not repeat may be noise. Two trials with
the same times and commands differ by their noise alone, less what follows the state or the command
(a rig that warms up between them): that is taken out first. Without repeats, long rest segments
tell the colour, and nothing tells a drift.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.discovery.preparation.acceptance_floors import repeats
from pma_gym.discovery.preparation.noise import Whitening, autoregression, rest_readings
from pma_gym.discovery.preparation.nuisance_projection import (
    drift_columns,
    half_periods,
    line_columns,
)
from pma_gym.discovery.thresholds import (
    DRIFT_CHANCE,
    DRIFT_ENLARGED,
    ENOUGH_FOR_COLOUR,
    LEAST_CHANGE,
    MOST_MISSING,
    MOST_WAVES,
    WAVE_CHANCE,
)
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

NEAR = 16
"""Neighbours above a drift's cosines that tell how much noise without drift has there."""


def learnt_noise(
    noise: Sequence[Whitening], logged: Sequence[Logged], named: Sequence[NamedTrial]
) -> tuple[Whitening, ...]:
    """Whitening of each signal with the colour and the drift that repeats and rest tell.

    Args:
        noise: white noise of the levels that are known.
        logged: the trials.
        named: the same, with what is known of repeats.
    """
    pairs = [
        (i, j) for group in repeats(logged, named) for i, j in zip(group, group[1:], strict=False)
    ]
    learnt = []
    drifts = [_drift(logged, pairs, channel, each.level) for channel, each in enumerate(noise)]
    surely = any(each.chance < DRIFT_CHANCE / len(noise) for each in drifts)
    shares = [each.share for each in drifts if np.isfinite(each.share)]
    usual = float(np.sqrt(np.mean(np.square(shares)))) if shares else 0.0
    for channel, before in enumerate(noise):
        waves, share = drifts[channel].waves, 0.0
        if surely and np.isfinite(drifts[channel].share):
            # One pair of repeats tells a size badly; drifts of one rig's sensors are alike.
            share = DRIFT_ENLARGED * max(usual, drifts[channel].share)
        is_drifting = share > LEAST_CHANGE
        after = _coloured(before, logged, pairs, channel, waves, is_drifting)
        if is_drifting:
            after = replace(after, drift=share * before.level, waves=waves)
        learnt.append(after)
    return tuple(learnt)


def _coloured(
    before: Whitening,
    logged: Sequence[Logged],
    pairs: Sequence[tuple[int, int]],
    channel: int,
    waves: int,
    is_drifting: bool,
) -> Whitening:
    """With the colour of what repeats differ by, or else of rest segments."""
    parts = [
        _noise_of_pair(logged, i, j, channel, before.lines, waves, is_drifting) for i, j in pairs
    ]
    parts = [part for part in parts if part.size]
    if sum(int(np.isfinite(part).sum()) for part in parts) < ENOUGH_FOR_COLOUR:
        parts = rest_readings(logged, channel)
        if before.lines or sum(int(np.isfinite(part).sum()) for part in parts) < ENOUGH_FOR_COLOUR:
            return before
    return replace(autoregression(parts, before.level), lines=before.lines)


@dataclass(frozen=True)
class _Drift:
    """Of one signal.

    Attributes:
        share: of the noise (rms), NaN if unknown.
        chance: how likely by chance.
        waves: half waves of it in a trial, beyond those that commands leave free; else 0.
    """

    share: float
    chance: float
    waves: int = 0


def _drift(
    logged: Sequence[Logged],
    pairs: Sequence[tuple[int, int]],
    channel: int,
    noise_level: float,
) -> _Drift:
    """Drift of a signal: how much repeats differ by slow cosines, beyond what noise does.

    Args:
        logged: the trials.
        pairs: which of them repeat each other.
        channel: the signal.
        noise_level: standard deviation of its noise (SI).
    """
    squares, total, least = [], 0.0, MOST_WAVES
    for i, j in pairs:
        apart = _apart(logged[i], logged[j], channel)
        if not apart.size:
            continue
        apart = apart[_reading_rows(logged[i], logged[j])]
        if len(apart) < MOST_WAVES + NEAR:
            # The cosines of so few readings are no basis: they tell no slow wave from noise.
            continue
        at, there = np.arange(len(apart)), np.isfinite(apart)
        apart = np.interp(at, at[there], apart[there])
        squares.append((_cosines(len(apart), MOST_WAVES + NEAR) @ (apart - apart.mean())) ** 2)
        total += len(apart)
        least = min(least, half_periods(logged[i]))
    if not squares:
        return _Drift(np.nan, 1.0)
    # The median, for what is no whole number of half waves leaks into the neighbours.
    beside = np.array(squares)[:, MOST_WAVES:]
    level = float(np.median(beside) / chi2.median(1))
    if level <= 0.0:
        return _Drift(np.nan, 1.0)
    powers = np.sum(squares, axis=0)[:MOST_WAVES] / level
    single = chi2.sf(powers, len(squares)) * MOST_WAVES
    waves = max([k + 1 for k in range(least, MOST_WAVES) if single[k] < WAVE_CHANCE], default=0)
    most = max(least, waves)
    slow = float(powers[:most].sum())
    count = most * len(squares)
    # Coloured noise has more at these frequencies than its standard deviation says.
    per_noise = math.sqrt(level) / noise_level
    share = per_noise * math.sqrt(max(slow - count, 0.0) / total)
    return _Drift(float(share), float(chi2.sf(slow, count)), waves)


def _cosines(rows: int, count: int) -> Array:
    """Orthonormal cosines of half a period and more, shape (count, rows)."""
    at = (np.arange(rows) + 0.5) / rows
    return np.sqrt(2.0 / rows) * np.cos(np.pi * np.arange(1, count + 1)[:, None] * at)


def _noise_of_pair(
    logged: Sequence[Logged],
    i: int,
    j: int,
    channel: int,
    lines: Sequence[float],
    waves: int,
    is_drifting: bool,
) -> Array:
    """What two repeats differ by over root 2 (SI), less what follows state and command.

    Less lines and what drifts, too; NaN where a reading is missing. Empty where `_apart` is. Sines
    are taken out only where there is a drift: what few readings lose by them looks like colour.
    """
    one, other = logged[i], logged[j]
    apart = _apart(one, other, channel)
    if not apart.size:
        return apart
    columns = [np.ones(len(one.time)), one.motor, one.regulator]
    columns += [np.sign(np.gradient(each)) for each in (one.motor, one.regulator)]
    there = np.isfinite(apart)
    read = one.counts * other.counts > 0.0
    for row, known in zip(0.5 * (one.measured + other.measured), read, strict=True):
        # A signal that is not read, or not where this one is, says nothing of it.
        if known[there].all() and np.ptp(row[there]) > 0.0:
            columns.append(row)
    slow = drift_columns(one, waves)
    columns += slow if is_drifting else slow[::2]
    for hertz in lines:
        columns += line_columns(hertz, one.time)
    basis = np.linalg.qr(np.stack(columns, axis=1)[there])[0]
    apart[there] -= basis @ (basis.T @ apart[there])
    return apart[_reading_rows(one, other)]


def _apart(one: Logged, other: Logged, channel: int) -> Array:
    """What two repeats differ by over root 2 (SI), NaN where either has no reading, shape (rows,).

    Empty where their times differ, or more than `MOST_MISSING` of the readings are missing: a
    series with many holes tells no colour. Rows of commands alone are no holes.
    """
    if not np.array_equal(one.time, other.time):
        return np.empty(0)
    read = (one.counts[channel] > 0.0) & (other.counts[channel] > 0.0)
    if not read.any() or np.mean(~read[_reading_rows(one, other)]) > MOST_MISSING:
        return np.empty(0)
    apart = np.full(len(one.time), np.nan)
    apart[read] = (other.measured[channel] - one.measured[channel])[read] / np.sqrt(2.0)
    return apart


def _reading_rows(one: Logged, other: Logged) -> NDArray[np.bool_]:
    """Where two repeats have a reading of any signal; long logs keep rows of commands alone."""
    return np.asarray(np.any(one.counts + other.counts > 0.0, axis=0))
