"""Colour and drift of the noise, learnt where nothing but noise differs: repeats, and rest.

What repeats with the command is structure; only what does not repeat may be noise. Two trials with
the same times and commands differ by their noise alone, less what follows the state or the command
(a rig that warms up between them): that is taken out first. Without repeats, long rest segments
tell the colour, and nothing tells a drift.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.discovery.preparation.acceptance_floors import difference, repeats
from pma_gym.discovery.preparation.noise import Whitening, autoregression, rest_readings
from pma_gym.discovery.preparation.nuisance_projection import drift_cosines
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

ENOUGH_ALIKE = 400
"""Least number of readings in repeats, or at rest, from which the colour of noise is learnt."""

CHANCE = 1e-3
"""That noise without a drift is taken for one with a drift, over all signals."""

UNSURE = 2.0
"""By what a drift that repeats tell is enlarged: a pair of them tells its size to a factor of two,
and too small a size leaves a drift that looks like the rig's."""

LEAST_DRIFT = 0.15
"""Drift (rms) in standard deviations of the noise, below which it counts as none."""

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
    drifts = [_drift(logged, pairs, channel) for channel in range(len(noise))]
    surely = any(each.chance < CHANCE / len(noise) for each in drifts)
    shares = [each.share for each in drifts if np.isfinite(each.share)]
    usual = float(np.sqrt(np.mean(np.square(shares)))) if shares else 0.0
    for channel, before in enumerate(noise):
        after = _coloured(before, logged, pairs, channel)
        if surely and np.isfinite(drifts[channel].share):
            # One pair of repeats tells a size badly; drifts of one rig's sensors are alike.
            share = UNSURE * max(usual, drifts[channel].share)
            if share > LEAST_DRIFT:
                after = replace(after, drift=share * before.level)
        learnt.append(after)
    return tuple(learnt)


def _coloured(
    before: Whitening, logged: Sequence[Logged], pairs: Sequence[tuple[int, int]], channel: int
) -> Whitening:
    """With the colour of what repeats differ by, or else of rest segments."""
    parts = [_noise_of_pair(logged, i, j, channel, before.lines) for i, j in pairs]
    parts = [part for part in parts if part.size]
    if sum(map(len, parts)) < ENOUGH_ALIKE:
        parts = rest_readings(logged, channel)
        if before.lines or sum(int(np.isfinite(part).sum()) for part in parts) < ENOUGH_ALIKE:
            return before
    return replace(autoregression(parts, before.level), lines=before.lines)


@dataclass(frozen=True)
class _Drift:
    """Of one signal: its share of the noise (rms), NaN if unknown, and how likely by chance."""

    share: float
    chance: float


def _drift(logged: Sequence[Logged], pairs: Sequence[tuple[int, int]], channel: int) -> _Drift:
    """Drift of a signal: how much repeats differ by slow cosines, beyond what noise does."""
    power, total, count, beside = 0.0, 0.0, 0, []
    for i, j in pairs:
        apart = difference(logged[i], logged[j], channel) / np.sqrt(2.0)
        if apart.size != len(logged[i].time):
            continue
        slow = len(drift_cosines(logged[i]))
        waves = _cosines(len(apart), slow + NEAR)
        sizes = waves @ (apart - apart.mean())
        power += float(np.sum(sizes[:slow] ** 2))
        beside.append(float(np.mean(sizes[slow:] ** 2)))
        total += len(apart)
        count += slow
    if not count:
        return _Drift(np.nan, 1.0)
    level = float(np.mean(beside))
    if level <= 0.0:
        return _Drift(np.nan, 1.0)
    share = np.sqrt(max(power - count * level, 0.0) / total / level)
    return _Drift(float(share), float(chi2.sf(power / level, count)))


def _cosines(rows: int, count: int) -> Array:
    """Orthonormal cosines of half a period and more, shape (count, rows)."""
    at = (np.arange(rows) + 0.5) / rows
    return np.sqrt(2.0 / rows) * np.cos(np.pi * np.arange(1, count + 1)[:, None] * at)


def _noise_of_pair(
    logged: Sequence[Logged], i: int, j: int, channel: int, lines: Sequence[float]
) -> Array:
    """What two repeats differ by over root 2 (SI), less what follows state and command.

    Less lines and what drifts, too. Empty where their times differ, or readings are missing.
    """
    apart = difference(logged[i], logged[j], channel) / np.sqrt(2.0)
    one, other = logged[i], logged[j]
    if apart.size != len(one.time):
        return np.empty(0)
    columns = [np.ones(len(one.time)), one.motor, one.regulator]
    columns += [np.sign(np.gradient(each)) for each in (one.motor, one.regulator)]
    columns += [row for row in 0.5 * (one.measured + other.measured) if np.ptp(row) > 0.0]
    columns += drift_cosines(one)
    for hertz in lines:
        angle = 2.0 * np.pi * hertz * one.time
        columns += [np.cos(angle), np.sin(angle)]
    basis = np.linalg.qr(np.stack(columns, axis=1))[0]
    return apart - basis @ (basis.T @ apart)
