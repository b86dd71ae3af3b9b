"""Long logs with fewer rows: readings averaged, commands kept.

What a diagnosis costs grows with its rows. Readings are averaged over blocks of rows: nothing
faster folds into what is left, and their noise falls. The average is a parabola's value at the
block's middle (Savitzky and Golay), since a plain mean cuts the corners of a course, which a fit
takes for physics. Commands keep every row that joining the others would miss.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial

Array = NDArray[np.float64]

MOST_ROWS = 60_000
"""Rows of all trials together from which on they are averaged."""

AIM_ROWS = 16_000
"""Rows that are aimed at then."""

SLOWEST_HZ = 60.0
"""Least rate that is left: slower would hide the rotor's oscillation on the cable."""

PARABOLA = 4
"""Fewest readings that a parabola is drawn through."""

SAME = 1e-3
"""Share of the rows' distance within which two times are one."""

WORTH = 0.5
"""Most rows that a trial may keep, as a share of its own: a command that changes in every row, as a
noisy controller's does, needs them all, and averages of readings would only hide the fastest."""

CURVATURE = 1e-4
"""Largest change of a command by leaving rows out, as a share of its span."""


def averaged(named: Sequence[NamedTrial]) -> tuple[list[NamedTrial], list[str]]:
    """Trials with fewer rows where they have very many, and what to say of that.

    Args:
        named: the trials.
    Returns:
        The trials, the same where they have few rows; and words.
    """
    total = sum(len(each.trial) for each in named)
    if total <= MOST_ROWS:
        return list(named), []
    wanted = math.ceil(total / AIM_ROWS)
    kept, factors = [], []
    for each in named:
        rate = 1.0 / float(np.median(np.diff(each.trial.time)))
        factor = max(1, min(wanted, int(rate / SLOWEST_HZ)))
        factors.append(factor)
        fewer = each.trial if factor == 1 else _fewer(each.trial, factor)
        if len(fewer) > WORTH * len(each.trial):
            fewer, factors[-1] = each.trial, 1
        kept.append(replace(each, trial=fewer))
    left = sum(len(each.trial) for each in kept)
    if max(factors) == 1:
        return list(named), []
    least, most = min(factors), max(factors)
    how = f"{most}" if least == most else f"{least} to {most}"
    trials = f"the {len(named)} trials have" if len(named) > 1 else "the trial has"
    return kept, [
        f"{trials} {total} rows: readings are averaged over {how} rows each, "
        f"which leaves {left}; commands are kept to 0.01 % of their range. What is faster "
        "than that is not looked for: cut the log to the part that matters if you need it"
    ]


def _fewer(trial: Trial, factor: int) -> Trial:
    """A trial with a reading for each block of rows, at the block's middle in time."""
    blocks = len(trial) // factor
    inner = np.arange(blocks * factor).reshape(blocks, factor)
    middles = _middles(trial.time[inner])
    extra = _bends(trial, middles)
    time = np.unique(np.concatenate([trial.time[:1], middles, trial.time[extra]]))
    commands = {name: _interpolated(trial.time, row, time) for name, row in trial.commands.items()}
    at = np.searchsorted(time, middles)
    measurements = {}
    for name, row in trial.measurements.items():
        measurements[name] = np.full(time.size, np.nan)
        # A block with a gap has no middle of its own: NaN stays.
        measurements[name][at] = row[inner] @ _weights(factor)
    kept = {"provenance": trial.provenance, "memory_at_start": trial.memory_at_start}
    return Trial(time, commands, measurements, **kept)


def _middles(times: Array) -> Array:
    """The middle of each block of times, shape (blocks, rows); its middle row where it has one.

    A mean misses that row by what numbers round: two rows would lie next to no time apart.
    """
    means, inner = times.mean(axis=1), times[:, (times.shape[1] - 1) // 2]
    return np.where(np.abs(means - inner) < SAME * np.diff(times[0]).mean(), inner, means)


def _weights(count: int) -> Array:
    """Weights of a block's readings in the value at its middle: a parabola's, of 3 the mean's."""
    if count < PARABOLA:
        return np.full(count, 1.0 / count)
    along = np.arange(count) - (count - 1) / 2.0
    return np.linalg.pinv(np.stack([np.ones(count), along, along**2], axis=1))[0]


def _interpolated(time: Array, row: Array, at: Array) -> Array:
    """A command at other times; an empty cell holds the value before it."""
    given = np.flatnonzero(np.isfinite(row))
    if not given.size:
        return np.full(at.size, np.nan)
    last = np.maximum.accumulate(np.where(np.isfinite(row), np.arange(row.size), given[0]))
    return np.interp(at, time, row[last])


def _bends(trial: Trial, times: Array) -> NDArray[np.int64]:
    """Rows that commands need beside some times, so that joining them gives what they were."""
    needed: set[int] = set()
    for row in trial.commands.values():
        values = _interpolated(trial.time, row, trial.time)
        span = float(np.ptp(values))
        if not span > 0.0:
            continue
        knots = np.unique(np.concatenate([trial.time[[0, -1]], times]))
        for _ in range(8):
            drawn = np.interp(trial.time, knots, np.interp(knots, trial.time, values))
            off = np.abs(drawn - values) > CURVATURE * span
            if not off.any():
                break
            added = np.flatnonzero(off)
            needed.update(added.tolist())
            knots = np.unique(np.concatenate([knots, trial.time[added]]))
    return np.array(sorted(needed), np.int64)
