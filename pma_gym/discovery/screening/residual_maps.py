"""Maps of a signal's residual over the two conditions that explain most of it."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import Signal
from pma_gym.discovery.result.misfit import Map
from pma_gym.discovery.screening.regions import SPEED, Axis, level_axes
from pma_gym.discovery.screening.time_bins import TimeBins

Array = NDArray[np.float64]

CELLS = 10
"""Cells along each axis of a map."""

_TIMES = (
    Axis("reversal", "time since reversal", "s"),
    Axis("held", "time since the last motion", "s"),
)


def residual_map(bins: TimeBins, channel: int, signals: Sequence[Signal]) -> Map:
    """A signal's mean residual over the two conditions that explain most of it.

    Args:
        bins: all trials.
        channel: which of the rig's signals.
        signals: what the rig measures.
    """
    known = (*level_axes(signals), SPEED, *_TIMES)
    axes = {axis.kind: f"{axis.words} ({axis.unit})" for axis in known}
    total, counts = bins.total[channel], bins.counts[channel]
    edges = {name: _edges(getattr(bins, name)[counts > 0]) for name in axes}
    best = None
    for x, y in combinations(axes, 2):
        sums, there = _grid(bins, x, y, edges, total), _grid(bins, x, y, edges, counts)
        filled = there > 0
        means = np.divide(sums, there, out=np.full_like(sums, np.nan), where=filled)
        # What noise alone would make of so many cells is no explanation.
        explained = float(np.sum(sums[filled] * means[filled]) - np.sum(filled))
        if best is None or explained > best[0]:
            best = explained, x, y, means
    assert best is not None
    _, x, y, means = best
    return Map(signals[channel].column, axes[x], axes[y], edges[x], edges[y], means)


def _grid(bins: TimeBins, x: str, y: str, edges: Mapping[str, Array], weights: Array) -> Array:
    """Sums over cells, shape (cells of y, cells of x)."""
    across, along = getattr(bins, x), getattr(bins, y)
    there = np.isfinite(across) & np.isfinite(along) & (weights != 0.0)
    columns = _cell(across[there], edges[x])
    rows = _cell(along[there], edges[y])
    width, height = len(edges[x]) - 1, len(edges[y]) - 1
    flat = np.bincount(rows * width + columns, weights[there], width * height)
    return np.asarray(flat, float).reshape(height, width)


def _cell(values: Array, edges: Array) -> NDArray[np.intp]:
    at = np.searchsorted(edges, values, side="right") - 1
    return np.clip(at, 0, len(edges) - 2)


def _edges(values: Array) -> Array:
    """Even cells over all but the outermost values, which count with the outermost cells."""
    known = values[np.isfinite(values)]
    if not known.size:
        return np.array([0.0, 1.0])
    low, high = np.quantile(known, [0.01, 0.99])
    if high - low <= 1e-6 * max(abs(low), abs(high), 1e-6):
        # A condition that does not vary explains nothing: one cell.
        return np.array([low - 0.5, low + 0.5])
    return np.linspace(low, high, CELLS + 1)
