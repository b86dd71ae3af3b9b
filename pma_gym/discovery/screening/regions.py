"""Regions of one condition, in words: where readings were taken, as a person says it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import Signal
from pma_gym.discovery.screening.time_bins import TimeBins
from pma_gym.discovery.thresholds import LARGEST_REGION, SMALLEST_REGION

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Axis:
    """A condition that has a size.

    Attributes:
        kind: its field in `TimeBins`.
        words: what it is.
        unit: what it is given in there.
    """

    kind: str
    words: str
    unit: str


SPEED = Axis("speed", "speed of contraction", "mm/s")


def level_axes(signals: Sequence[Signal]) -> tuple[Axis, ...]:
    """Pressure, force and position of a rig, as its signals are called."""
    force, *_ = (each.name for each in signals if each.measures == "force")
    return (
        Axis("pressure", "pressure", "kPa"),
        Axis("load", force, "N"),
        Axis("position", "contraction", "mm"),
    )


@dataclass(frozen=True)
class Region:
    """One condition, or two.

    Attributes:
        kinds: what they are about; two of one kind are never joined.
        words: in words.
        inside: which ticks it holds, shape (n,).
    """

    kinds: tuple[str, ...]
    words: str
    inside: Mask


def single_regions(bins: TimeBins, levels: Sequence[Axis]) -> list[Region]:
    """Regions of one condition, those of motion first, as a person says them.

    Args:
        bins: all trials.
        levels: pressure, force and position of the rig.
    """
    there = np.isfinite(bins.order)
    held, speed = bins.held, bins.speed
    named: list[tuple[str, str, Mask]] = []
    for kind, words in (("reversal", "reversals"), ("step", "steps of a command")):
        since = np.where(there, getattr(bins, kind), np.nan)
        named += [(kind, f"0-{t:g} s after {words}", since <= t) for t in (0.1, 0.2, 0.5)]
        named.append((kind, f"more than 1 s after {words}", (since > 1.0) & np.isfinite(since)))
    named.append(("motion", "while held", held > 0.0))
    named.append(("motion", "while held, more than 1 s after the last motion", held > 1.0))
    moving = held == 0.0
    for sign, words in ((1.0, "shortening"), (-1.0, "pulling out")):
        along = np.where(moving, sign * speed, np.nan)
        named.append(("motion", f"while {words}", along > 0.0))
        named += [
            ("motion", f"{words} faster than {v:g} {SPEED.unit}", along > v)
            for v in _round_cuts(along[along > 0.0], (0.5, 0.8))
        ]
    named.append(("motion", "while moving", moving))
    crawl = _round_cuts(np.abs(speed[moving]), (0.3,))
    named += [
        ("motion", f"moving slower than {v:g} {SPEED.unit}", moving & (abs(speed) < v))
        for v in crawl
    ]
    phases = ("before the first command", "between the first command and the last", "")
    for number, words in enumerate(phases[:2]):
        named.append(("phase", words, bins.phase == number))
    named.append(("phase", "in the final hold", bins.phase > 1.0))
    for axis in levels:
        values = getattr(bins, axis.kind)
        # A pressure is known by its unit.
        name = "" if axis.unit == "kPa" else f"{axis.words} "
        for cut in _round_cuts(values[there], (0.2, 0.4, 0.6, 0.8)):
            named.append((axis.kind, f"{name}above {cut:g} {axis.unit}", values > cut))
            named.append((axis.kind, f"{name}under {cut:g} {axis.unit}", values < cut))
    named.append(("order", "in the first half of the trials", 2.0 * bins.order < 1.0))
    named.append(("order", "in the second half of the trials", 2.0 * bins.order > 1.0))
    count = int(there.sum())
    kept = {}
    for kind, words, inside in named:
        if SMALLEST_REGION * count <= inside.sum() <= LARGEST_REGION * count:
            # Of two ways to say the same, the first.
            kept.setdefault(inside.tobytes(), Region((kind,), words, inside))
    return list(kept.values())


def _round_cuts(values: Array, quantiles: Sequence[float]) -> list[float]:
    """Round numbers near quantiles, distinct and within the values."""
    if not values.size:
        return []
    low, high = np.quantile(values, [0.01, 0.99])
    span = high - low
    if span <= 1e-3 * max(abs(low), abs(high), 1e-9):
        return []
    # The roundest step that still tells the quantiles apart.
    step = 10.0 ** np.floor(np.log10(span / 4.0))
    cuts = {float(np.round(np.quantile(values, q) / step) * step) for q in quantiles}
    return sorted(round(cut, 9) for cut in cuts if low < cut < high)
