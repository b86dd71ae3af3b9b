"""Signatures of a residual as numbers: how much, where, and along what.

What `pma_gym.discovery.screening.localisation` localises, at the same conditions for every data
set: for each signal
the size of the refitted model's residual, how much of its gap lies in each region, and how it goes
with what the effects of the catalogue would make of it.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from benchmarks.hidden_effects.baselines.preparation import Prepared
from pma_gym.discovery.screening.time_bins import BIN_S, TimeBins
from pma_gym.discovery.screening.time_bins import time_bins as padded_bins
from pma_gym.plant.rigs import RIGS

Array = NDArray[np.float64]

SLACK_N = 20.0
"""Loads below which a cable may hang through (N)."""

FAST_MM_S, HIGH_KPA = 10.0, 372.0
"""A speed above which motion is fast, and the pressure at which the muscle's damping changes."""


def time_bins(ready: Prepared) -> TimeBins:
    """All trials in bins of 50 ms, without padding."""
    bins = padded_bins(ready.whitened.logged, ready.readings, ready.left)
    there = np.isfinite(bins.order)
    return TimeBins(**{name: each[..., there] for name, each in vars(bins).items()})


def means(some: TimeBins) -> Array:
    """Mean residual of each signal in each bin, in units of the noise, shape (4, n)."""
    return some.total / np.maximum(some.counts, 1.0)


def regions(some: TimeBins) -> dict[str, NDArray[np.bool_]]:
    """Regions that all data sets have in common, shape (n,) each."""
    moving = some.held == 0.0
    return {
        "reversal": some.reversal <= 0.2,
        "step": some.step <= 0.2,
        "held": some.held > 1.0,
        "shortening": moving & (some.speed > 0.0),
        "relaxing": moving & (some.speed < 0.0),
        "fast": np.abs(some.speed) > FAST_MM_S,
        "slow": moving & (np.abs(some.speed) < 0.1 * FAST_MM_S),
        "slack": some.load < SLACK_N,
        "loaded": some.load > 0.9 * np.max(some.load),
        "stretched": some.position < 0.0,
        "shortened": some.position > 0.7 * np.max(some.position),
        "pressed": some.pressure > HIGH_KPA,
        "early": some.order < 0.2,
        "final hold": some.phase == 2.0,
    }


def courses(some: TimeBins) -> dict[str, Array]:
    """What effects would go along with, shape (n,) each; not centred, not scaled."""
    rates = {name: _rate(some, getattr(some, name)) for name in ("load", "pressure", "position")}
    by_name = {
        "speed": some.speed,
        "direction": np.sign(np.where(some.held == 0.0, some.speed, 0.0)),
        "load rate": rates["load"],
        "pressure rate": rates["pressure"],
        "venting": np.minimum(rates["pressure"], 0.0),
        "fast pressure": rates["pressure"] * np.abs(rates["pressure"]),
        "contraction": some.position,
        "contraction squared": some.position**2,
        "stretch": np.minimum(some.position, 0.0),
        "load": some.load,
        "low load": np.exp(-some.load / SLACK_N),
        "loaded speed": some.load * some.speed,
        "pressed speed": some.pressure * some.speed,
        "fading": np.exp(-some.pressure / 100.0) * np.exp(-5.0 * some.order),
        "held": np.minimum(some.held, 3.0),
        "play": _play(some, 1.5),
    }
    for time in (2.0, 40.0):
        by_name[f"creep {time:g} s"] = some.position - _lagged(some, time)
    return by_name


def signature(ready: Prepared) -> dict[str, float]:
    """The numbers, by name; the same names for every data set."""
    some = time_bins(ready)
    values = {f"step of {name}": step for name, step in _steps(ready).items()}
    across, along = regions(some), courses(some)
    left = means(some)
    for channel, name in enumerate(RIGS["station"].outputs):
        excess, counts = some.excess[channel], some.counts[channel]
        total = max(float(np.sum(excess)), 1e-9 * max(float(np.sum(counts)), 1.0))
        values[f"size of {name}"] = float(np.log1p(max(total, 0.0) / max(np.sum(counts), 1.0)))
        for where, inside in across.items():
            there = max(float(np.sum(counts[inside])), 1.0)
            values[f"{name} at {where}"] = float(np.arcsinh(np.sum(excess[inside]) / there))
        for what, course in along.items():
            values[f"{name} along {what}"] = _correlation(some, left[channel], course)
    return values


def _steps(ready: Prepared) -> Mapping[str, float]:
    """How many of the DAQ's steps the readings keep to."""
    return {
        name: floor.step / floor.expected_step
        for name, floor in zip(RIGS["station"].outputs, ready.floors, strict=True)
    }


def _correlation(some: TimeBins, left: Array, course: Array) -> float:
    """Correlation in all trials, each about its own means; 0 where one of them does not vary."""
    both = within(some, np.stack([left, course]))
    products = both @ both.T
    scale = float(np.sqrt(products[0, 0] * products[1, 1]))
    return float(products[0, 1] / scale) if scale > 0.0 else 0.0


def within(some: TimeBins, values: Array) -> Array:
    """Values, shape (k, n), less their mean in each trial."""
    clipped = values.copy()
    for order in np.unique(some.order):
        here = some.order == order
        clipped[:, here] -= clipped[:, here].mean(axis=1, keepdims=True)
    return clipped


def _by_trial(some: TimeBins) -> list[slice]:
    edges = [0, *(np.flatnonzero(np.diff(some.order)) + 1).tolist(), len(some.order)]
    return [slice(a, b) for a, b in zip(edges, edges[1:], strict=False)]


def _rate(some: TimeBins, values: Array) -> Array:
    """Derivative in time within each trial (per s)."""
    parts = [values[each] for each in _by_trial(some)]
    return np.concatenate([np.gradient(p, BIN_S) if len(p) > 1 else 0.0 * p for p in parts])


def _lagged(some: TimeBins, time: float) -> Array:
    """Contraction (mm) that follows with a time constant (s), from where each trial begins."""
    output = np.empty_like(some.position)
    keep = np.exp(-BIN_S / time)
    for each in _by_trial(some):
        here = some.position[each]
        state = here[0]
        for k, value in enumerate(here):
            state = keep * state + (1.0 - keep) * value
            output[each.start + k] = state
    return output


def _play(some: TimeBins, distance: float) -> Array:
    """Force of friction that builds up over a way (mm), -1 to 1: from 0 in each trial."""
    output = np.zeros_like(some.position)
    for each in _by_trial(some):
        here, state = some.position[each], 0.0
        for k in range(1, len(here)):
            state = float(np.clip(state + (here[k] - here[k - 1]) / distance, -1.0, 1.0))
            output[each.start + k] = state
    return output
