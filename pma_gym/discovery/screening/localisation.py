"""Where a model and its trials disagree, in words, and maps of it over two conditions.

The gap of a signal is its residual's mean square beyond the noise. Regions are one condition, such
as "while held", or two of different kinds together; the share of the gap that lies in one is set
against the share of readings that do. Chance is simulated by dealing the pieces of a second, each
with its gap, anew over all trials.

The residual is taken in units of the noise, not whitened: whitening leaves little of a gap that
changes slowly, and such are the gaps that a person sees.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import Signal
from pma_gym.discovery.fitting.fit_problem import Fitted
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.result.misfit import Map, Place
from pma_gym.discovery.screening.regions import Region, level_axes, single_regions
from pma_gym.discovery.screening.residual_maps import residual_map
from pma_gym.discovery.screening.residuals import simulated_less_measured
from pma_gym.discovery.screening.time_bins import PIECE_BINS, TimeBins, time_bins
from pma_gym.discovery.thresholds import (
    LARGEST_REGION,
    LEAST_LIFT,
    LEAST_SHARE,
    MOST_OF_A_SIGNAL,
    MOST_REGIONS,
    OVERLAP,
    SECOND_WORTH,
    SIGNIFICANT,
    SMALLEST_REGION,
    VISIBLE,
)

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Single = NDArray[np.float32]

RESAMPLES = 999
"""Deals for p-values."""


def localise(
    whitened: WhitenedResiduals, fit: Fitted, noise_levels: Sequence[float] | Array, seed: int
) -> tuple[tuple[Place, ...], tuple[Map, ...]]:
    """Where the residual of a fitted model lies.

    Args:
        whitened: the trials beside the model.
        fit: its parameters.
        noise_levels: standard deviations of the signals' noise (SI), shape (signals,).
        seed: of the simulated residuals.
    Returns:
        Regions, the largest share of its signal's gap first, and a map for each signal with a gap.
    """
    readings = whitened.readings(fit.values)
    if readings is None:
        return (), ()
    levels = np.asarray(noise_levels, float)[:, None]
    residuals = [part / levels for part in simulated_less_measured(whitened, readings)]
    bins = time_bins(whitened.logged, readings, residuals)
    seen = [channel for channel in range(len(bins.total)) if _has_gap(bins, channel)]
    signals = whitened.logged[0].signals
    maps = tuple(residual_map(bins, channel, signals) for channel in seen)
    return _places(bins, signals, seen, seed), maps


def _has_gap(bins: TimeBins, channel: int) -> bool:
    count = np.sum(bins.counts[channel])
    return bool(count > 0 and np.sum(bins.excess[channel]) > (VISIBLE - 1.0) * count)


def _places(
    bins: TimeBins, signals: Sequence[Signal], seen: Sequence[int], seed: int
) -> tuple[Place, ...]:
    singles = single_regions(bins, level_axes(signals))
    regions = singles + [
        Region(first.kinds + second.kinds, "", first.inside & second.inside)
        for first, second in combinations(singles, 2)
        if first.kinds != second.kinds
    ]
    names = [(k,) for k in range(len(singles))] + [
        (i, j)
        for i, j in combinations(range(len(singles)), 2)
        if singles[i].kinds != singles[j].kinds
    ]
    if not seen or not regions:
        return ()
    inside = np.stack([region.inside for region in regions])
    generator = np.random.Generator(np.random.Philox(seed))
    pieces = inside.shape[1] // PIECE_BINS
    deals = generator.permuted(np.tile(np.arange(pieces), (RESAMPLES, 1)), axis=1)
    member = inside.astype(np.float32).T
    p_values = np.stack([_p_values(bins.excess[channel], member, deals) for channel in seen])
    p_values = adjusted(p_values.ravel()).reshape(p_values.shape)
    places = []
    for channel, p_value in zip(seen, p_values, strict=True):
        share, readings = _shares(bins, channel, member)
        for k in _shown(bins.excess[channel], inside, names, share, readings, p_value):
            words = ", ".join(singles[i].words for i in names[k])
            signal = signals[channel].column
            places.append(Place(signal, words, float(share[k]), float(p_value[k])))
    places.sort(key=lambda place: -place.share_of_gap)
    return tuple(places[:MOST_REGIONS])


def _shares(bins: TimeBins, channel: int, member: Single) -> tuple[Array, Array]:
    """Shares of a signal's gap, and of its readings, in regions; shape (regions,) each."""
    both = np.stack([bins.excess[channel], bins.counts[channel]])
    parts = (both.astype(np.float32) @ member).astype(np.float64)
    share, readings = parts / np.sum(both, axis=1)[:, None]
    return np.clip(share, 0.0, 1.0), readings


def _p_values(excess: Array, member: Single, deals: NDArray[np.int64]) -> Array:
    """Chance of so much gap in each region, had every piece's gap been any other's.

    Args:
        excess: shape (n,).
        member: 1 for the ticks of a region, shape (n, regions).
        deals: orders of the pieces, shape (RESAMPLES, pieces).
    """
    pieces = excess.reshape(-1, PIECE_BINS).astype(np.float32)
    dealt = pieces[deals].reshape(len(deals), -1)
    drawn, here = dealt @ member, excess.astype(np.float32) @ member
    # Single precision: what is equal but for rounding counts as equal.
    slack = 1e-5 * np.sum(np.abs(excess))
    return (1.0 + np.sum(drawn >= here - slack, axis=0)) / (len(deals) + 1.0)


def adjusted(p_values: Array) -> Array:
    """P-values for as many as there are (Benjamini and Hochberg 1995), shape kept.

    >>> adjusted(np.array([0.01, 0.04, 0.03, 0.5])).round(3).tolist()
    [0.04, 0.053, 0.053, 0.5]
    """
    order = np.argsort(p_values, kind="stable")
    ratio = p_values[order] * len(p_values) / np.arange(1, len(p_values) + 1)
    raised = np.empty_like(p_values)
    raised[order] = np.minimum(np.minimum.accumulate(ratio[::-1])[::-1], 1.0)
    return raised


def _shown(
    excess: Array,
    inside: Mask,
    names: Sequence[tuple[int, ...]],
    share: Array,
    readings: Array,
    p_value: Array,
) -> list[int]:
    """Regions that are told of one signal: high scores that hardly overlap."""
    score = _scores(share, readings)
    single = np.array([score[k] for k, name in enumerate(names) if len(name) == 1])
    alone = np.array([max(single[i] for i in name) if len(name) > 1 else 0.0 for name in names])
    good = (
        (p_value <= SIGNIFICANT)
        & (readings >= SMALLEST_REGION)
        & (readings <= LARGEST_REGION)
        & (share >= np.maximum(LEAST_SHARE, LEAST_LIFT * readings))
        & (score >= SECOND_WORTH * alone)
    )
    chosen: list[int] = []
    for k in sorted(np.flatnonzero(good).tolist(), key=lambda k: -score[k]):
        if len(chosen) == MOST_OF_A_SIGNAL:
            break
        own = excess @ inside[k]
        if all(excess @ (inside[k] & inside[other]) < OVERLAP * own for other in chosen):
            chosen.append(k)
    return chosen


def _scores(share: Array, readings: Array) -> Array:
    """Likelihood ratio of Kulldorff's scan: large where much of the gap lies in few readings."""
    s, n = np.clip(share, 1e-9, 1.0 - 1e-9), np.clip(readings, 1e-9, 1.0 - 1e-9)
    ratio = s * np.log(s / n) + (1.0 - s) * np.log((1.0 - s) / (1.0 - n))
    return np.where(s > n, ratio, 0.0)
