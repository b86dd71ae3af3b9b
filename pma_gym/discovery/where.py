"""Where a model and its trials disagree, in words, and maps of it over two conditions.

The gap of a signal is its residual's mean square beyond the noise. Regions are one condition, such
as "while held", or two of different kinds together; the share of the gap that lies in one is set
against the share of readings that do. Chance is simulated by dealing the pieces of a second, each
with its gap, anew over all trials.

The residual is taken in units of the noise, not whitened: whitening leaves little of a gap that
changes slowly, and such are the gaps that a person sees.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.diagnosis import Map, Place
from pma_gym.discovery.evidence import Evidence
from pma_gym.discovery.fits import Fitted
from pma_gym.discovery.leftovers import left_over
from pma_gym.plant.logged import Logged
from pma_gym.plant.plant import OUTPUTS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Single = NDArray[np.float32]

TICK_S = 0.05
"""Readings of so long (s) are taken together: finer than any region."""

PIECE_TICKS = 20
"""Ticks of a piece that is dealt as a whole: a second, longer than the memory of noise and
plant."""

RESAMPLES = 999
"""Deals for p-values."""

SIGNIFICANT = 0.05
"""Largest p-value of a region that is told."""

MOST_OF_A_SIGNAL, MOST = 3, 8
"""Regions that are told at most."""

SMALLEST, LARGEST = 0.02, 0.9
"""Shares of a signal's readings between which a region is one."""

LEAST_SHARE, LEAST_LIFT = 0.15, 1.25
"""Least share of the gap in a region that is told, and how many times its share of readings."""

SECOND_WORTH = 1.15
"""How many times the score of either must be that of two conditions together."""

OVERLAP = 0.5
"""Share of a region's gap that may lie in another that is told already."""

VISIBLE = 1.05
"""Mean square of a residual, in units of the noise's, from which there is a gap."""

MOVING = 0.5e-3
"""Slowest speed (m/s) that counts as motion."""

SMOOTH_S = 0.03
"""Width of the mean over simulated contraction that speed is taken of (s): not each slip of dry
friction is a reversal."""

STEP_V, STEP_V_PER_S = 0.1, 8.0
"""Least change of a command (V) between two rows, and its rate, that is a step."""

CELLS = 10
"""Cells along each axis of a map."""


@dataclass(frozen=True)
class Ticks:
    """All trials in ticks, padded to whole pieces; shape (n,) each unless said otherwise.

    Attributes:
        excess: sum of residual squared less 1, in units of noise, shape (4, n).
        total: sum of the residual, shape (4, n).
        counts: readings, shape (4, n); 0 where a tick is padding.
        pressure: (kPa), as simulated, as all conditions.
        load: (N).
        contraction: (mm).
        speed: of contraction (mm/s), positive where the muscle shortens.
        reversal: time since the last reversal of motion (s); infinite before the first.
        step: time since the last step of a command (s); infinite before the first.
        held: time since the last motion (s), 0 while moving.
        phase: 0 before the first change of a command, 1 from then on, 2 after the last.
        order: number of the trial, as a share of all, 0 to 1.
    """

    excess: Array
    total: Array
    counts: Array
    pressure: Array
    load: Array
    contraction: Array
    speed: Array
    reversal: Array
    step: Array
    held: Array
    phase: Array
    order: Array


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


def localise(
    evidence: Evidence, fit: Fitted, noise_levels: Sequence[float] | Array, seed: int
) -> tuple[tuple[Place, ...], tuple[Map, ...]]:
    """Where the residual of a fitted model lies.

    Args:
        evidence: the trials beside the model.
        fit: its parameters.
        noise_levels: standard deviations of the four signals' noise (SI), shape (4,).
        seed: of the simulated residuals.
    Returns:
        Regions, the largest share of its signal's gap first, and a map for each signal with a gap.
    """
    readings = evidence.readings(fit.values)
    if readings is None:
        return (), ()
    levels = np.asarray(noise_levels, float)[:, None]
    residuals = [part / levels for part in left_over(evidence, readings)]
    ticks = ticks_of(evidence.logged, readings, residuals)
    seen = [channel for channel in range(len(OUTPUTS)) if _has_gap(ticks, channel)]
    return _places(ticks, seen, seed), tuple(_map(ticks, channel) for channel in seen)


def _has_gap(ticks: Ticks, channel: int) -> bool:
    count = np.sum(ticks.counts[channel])
    return bool(count > 0 and np.sum(ticks.excess[channel]) > (VISIBLE - 1.0) * count)


# ---- conditions ----


def ticks_of(
    logs: Sequence[Logged], readings: Sequence[Array], residuals: Sequence[Array]
) -> Ticks:
    """All trials in ticks.

    Args:
        logs: the trials.
        readings: what the sensors hold (SI), shape (4, rows) for each trial.
        residuals: those less what was measured, in units of the noise, NaN where nothing was.
    """
    parts = []
    for number, (logged, held, residual) in enumerate(zip(logs, readings, residuals, strict=True)):
        order = number / max(len(logs) - 1, 1)
        parts.append(_of_trial(logged, held, residual, order))
    return Ticks(**{name: np.concatenate([p[name] for p in parts], axis=-1) for name in parts[0]})


def _of_trial(logged: Logged, held: Array, residual: Array, order: float) -> dict[str, Array]:
    time = logged.time
    width = max(TICK_S, float(np.median(np.diff(time)))) if len(time) > 1 else TICK_S
    starts = np.unique(np.floor((time - time[0]) / width + 1e-9), return_index=True)[1]
    known = np.isfinite(residual)
    filled = np.where(known, residual, 0.0)
    sums = {
        "excess": np.where(known, filled**2 - 1.0, 0.0),
        "total": filled,
        "counts": known.astype(float),
    }
    found = {name: np.add.reduceat(each, starts, axis=1) for name, each in sums.items()}
    # A tick's conditions are those of its middle row.
    middle = (starts + np.append(starts[1:], len(time)) - 1) // 2
    conditions = _conditions(logged, held) | {"order": np.full(len(time), order)}
    found |= {name: each[middle] for name, each in conditions.items()}
    spare = -len(starts) % PIECE_TICKS
    return {name: _padded(each, spare) for name, each in found.items()}


def _padded(values: Array, spare: int) -> Array:
    """Some more ticks: without readings, in a condition that lies in no region."""
    if values.ndim == 2:
        return np.pad(values, ((0, 0), (0, spare)))
    return np.pad(values, (0, spare), constant_values=np.nan)


def _conditions(logged: Logged, held: Array) -> dict[str, Array]:
    """Conditions of each row, from what is simulated: measured speed is mostly noise."""
    time, contraction = logged.time, held[0]
    speed = _speed(time, contraction)
    moving = np.abs(speed) > MOVING
    direction = np.where(moving, np.sign(speed), 0.0)
    # The direction of the last motion, also while held.
    last = np.maximum.accumulate(np.where(moving, np.arange(len(time)), -1))
    heading = np.where(last >= 0, direction[np.maximum(last, 0)], 0.0)
    turned = np.append(False, heading[1:] * heading[:-1] < 0.0)
    # What never moved has been held since the beginning.
    rested = np.where(last >= 0, time - time[np.maximum(last, 0)], time - time[0])
    changed = np.append(False, (np.diff(logged.motor) != 0) | (np.diff(logged.regulator) != 0))
    phase = np.zeros(len(time))
    if changed.any():
        rows = np.flatnonzero(changed)
        phase[rows[0] :] = 1.0
        phase[rows[-1] + 1 :] = 2.0
    return {
        "pressure": held[3] / 1e3,
        "load": held[2],
        "contraction": contraction * 1e3,
        "speed": speed * 1e3,
        "reversal": _since(time, turned),
        "step": _since(time, _stepped(logged)),
        "held": np.where(moving, 0.0, np.maximum(rested, 1e-9)),
        "phase": phase,
    }


def _speed(time: Array, contraction: Array) -> Array:
    if len(time) < 3:
        return np.zeros(len(time))
    width = max(1, round(SMOOTH_S / float(np.median(np.diff(time)))))
    sums = np.cumsum(np.append(0.0, contraction))
    half, rows = width // 2, np.arange(len(time))
    first, end = np.maximum(rows - half, 0), np.minimum(rows + half + 1, len(time))
    return np.gradient((sums[end] - sums[first]) / (end - first), time)


def _since(time: Array, event: Mask) -> Array:
    last = np.maximum.accumulate(np.where(event, np.arange(len(time)), -1))
    return np.where(last >= 0, time - time[np.maximum(last, 0)], np.inf)


def _stepped(logged: Logged) -> Mask:
    found = np.zeros(len(logged.time), bool)
    for volts in (logged.motor, logged.regulator):
        change = np.abs(np.diff(volts))
        found[1:] |= (change > STEP_V) & (change > STEP_V_PER_S * np.diff(logged.time))
    return found


# ---- regions ----


def _places(ticks: Ticks, seen: Sequence[int], seed: int) -> tuple[Place, ...]:
    singles = _singles(ticks)
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
    pieces = inside.shape[1] // PIECE_TICKS
    deals = generator.permuted(np.tile(np.arange(pieces), (RESAMPLES, 1)), axis=1)
    member = inside.astype(np.float32).T
    p_values = np.stack([_p_values(ticks.excess[channel], member, deals) for channel in seen])
    p_values = adjusted(p_values.ravel()).reshape(p_values.shape)
    found = []
    for channel, p_value in zip(seen, p_values, strict=True):
        share, readings = _shares(ticks, channel, member)
        for k in _told(ticks.excess[channel], inside, names, share, readings, p_value):
            words = ", ".join(singles[i].words for i in names[k])
            signal = BY_QUANTITY[OUTPUTS[channel]].name
            found.append(Place(signal, words, float(share[k]), float(p_value[k])))
    found.sort(key=lambda place: -place.share_of_gap)
    return tuple(found[:MOST])


def _shares(ticks: Ticks, channel: int, member: Single) -> tuple[Array, Array]:
    """Shares of a signal's gap, and of its readings, in regions; shape (regions,) each."""
    both = np.stack([ticks.excess[channel], ticks.counts[channel]])
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
    pieces = excess.reshape(-1, PIECE_TICKS).astype(np.float32)
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
    found = np.empty_like(p_values)
    found[order] = np.minimum(np.minimum.accumulate(ratio[::-1])[::-1], 1.0)
    return found


def _told(
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
        & (readings >= SMALLEST)
        & (readings <= LARGEST)
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


def _singles(ticks: Ticks) -> list[Region]:
    """Regions of one condition, those of motion first, as a person says them."""
    there = np.isfinite(ticks.order)
    held, speed = ticks.held, ticks.speed
    found: list[tuple[str, str, Mask]] = []
    for kind, words in (("reversal", "reversals"), ("step", "steps of a command")):
        since = np.where(there, getattr(ticks, kind), np.nan)
        found += [(kind, f"0-{t:g} s after {words}", since <= t) for t in (0.1, 0.2, 0.5)]
        found.append((kind, f"more than 1 s after {words}", (since > 1.0) & np.isfinite(since)))
    found.append(("motion", "while held", held > 0.0))
    found.append(("motion", "while held, more than 1 s after the last motion", held > 1.0))
    moving = held == 0.0
    for sign, words in ((1.0, "shortening"), (-1.0, "pulling out")):
        along = np.where(moving, sign * speed, np.nan)
        found.append(("motion", f"while {words}", along > 0.0))
        found += [
            ("motion", f"{words} faster than {v:g} mm/s", along > v)
            for v in _round_cuts(along[along > 0.0], (0.5, 0.8))
        ]
    found.append(("motion", "while moving", moving))
    crawl = _round_cuts(np.abs(speed[moving]), (0.3,))
    found += [
        ("motion", f"moving slower than {v:g} mm/s", moving & (abs(speed) < v)) for v in crawl
    ]
    phases = ("before the first command", "between the first command and the last", "")
    for number, words in enumerate(phases[:2]):
        found.append(("phase", words, ticks.phase == number))
    found.append(("phase", "in the final hold", ticks.phase == 2.0))
    for kind, name, unit in _LEVELS:
        values = getattr(ticks, kind)
        for cut in _round_cuts(values[there], (0.2, 0.4, 0.6, 0.8)):
            found.append((kind, f"{name}above {cut:g} {unit}", values > cut))
            found.append((kind, f"{name}under {cut:g} {unit}", values < cut))
    found.append(("order", "in the first half of the trials", ticks.order < 0.5))
    found.append(("order", "in the second half of the trials", ticks.order > 0.5))
    count = int(there.sum())
    kept = {}
    for kind, words, inside in found:
        if SMALLEST * count <= inside.sum() <= LARGEST * count:
            # Of two ways to say the same, the first.
            kept.setdefault(inside.tobytes(), Region((kind,), words, inside))
    return list(kept.values())


_LEVELS = (
    ("pressure", "", "kPa"),
    ("load", "load ", "N"),
    ("contraction", "contraction ", "mm"),
)


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


# ---- maps ----

_AXES: Mapping[str, str] = {
    "pressure": "pressure (kPa)",
    "load": "load (N)",
    "contraction": "contraction (mm)",
    "speed": "speed of contraction (mm/s)",
    "reversal": "time since reversal (s)",
    "held": "time since the last motion (s)",
}


def _map(ticks: Ticks, channel: int) -> Map:
    """The signal's mean residual over the two conditions that explain most of it."""
    total, counts = ticks.total[channel], ticks.counts[channel]
    edges = {name: _edges(getattr(ticks, name)[counts > 0]) for name in _AXES}
    best = None
    for x, y in combinations(_AXES, 2):
        sums, there = _grid(ticks, x, y, edges, total), _grid(ticks, x, y, edges, counts)
        filled = there > 0
        means = np.divide(sums, there, out=np.full_like(sums, np.nan), where=filled)
        # What noise alone would make of so many cells is no explanation.
        explained = float(np.sum(sums[filled] * means[filled]) - np.sum(filled))
        if best is None or explained > best[0]:
            best = explained, x, y, means
    assert best is not None
    _, x, y, means = best
    signal = BY_QUANTITY[OUTPUTS[channel]].name
    return Map(signal, _AXES[x], _AXES[y], edges[x], edges[y], means)


def _grid(ticks: Ticks, x: str, y: str, edges: Mapping[str, Array], weights: Array) -> Array:
    """Sums over cells, shape (cells of y, cells of x)."""
    across, along = getattr(ticks, x), getattr(ticks, y)
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


__all__ = ["Ticks", "adjusted", "localise", "ticks_of"]
