"""Long logs with fewer rows: readings averaged, commands kept.

What a diagnosis costs grows with its rows. Readings are averaged over blocks of rows: their noise
falls. The average is a parabola's value at the block's middle (Savitzky and Golay), since a plain
mean cuts the corners of a course, which a fit takes for physics. The price is that it passes 0.8 of
a wave as long as a block, which folds to a slow one: 60 Hz to 2.5 Hz where 1 kHz is averaged over
16 rows. Lines of mains are not looked for there, so blocks are as long as keeps them from folding
to it, where a length does. A block whose readings jump has no value, and none is given: friction
that turns round is a step. Commands keep every row that joining the others would miss.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.mains_lines import HARMONICS, MAINS_HZ, is_detectable
from pma_gym.discovery.preparation.noise import level_of_neighbours
from pma_gym.discovery.thresholds import (
    JUMP,
    LEAST_RATE_HZ,
    LINE_PASSES,
    NEAR_NYQUIST_HZ,
    RARE,
    WORTH_AVERAGING,
)

Array = NDArray[np.float64]

MOST_ROWS = 60_000
"""Rows of all trials together from which on they are averaged."""

AIM_ROWS = 16_000
"""Rows that are aimed at then."""

PARABOLA = 4
"""Fewest readings that a parabola is drawn through."""

SAME = 1e-3
"""Share of the rows' distance within which two times are one."""

CURVATURE, UNSEEN = 1e-4, 0.25
"""Largest change of a command by leaving rows out, as a share of its span: so much at most, and so
much of the share that the noise of a reading has of the reading's span. An encoder that tells a
millionth of its way tells a command that is off by more."""


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
    factors = [_factor(_rate(each.trial), wanted) for each in named]
    kept, off = list(named), _unseen(named)
    for factor in sorted(set(factors) - {1}):
        of_rate = [k for k, each in enumerate(factors) if each == factor]
        fewer = {k: _fewer(named[k].trial, factor, off) for k in of_rate}
        rows = sum(len(named[k].trial) for k in of_rate)
        if sum(map(len, fewer.values())) > WORTH_AVERAGING * rows:
            factors = [1 if each == factor else each for each in factors]
            continue
        for k, trial in fewer.items():
            kept[k] = replace(named[k], trial=trial)
    left = sum(len(each.trial) for each in kept)
    if max(factors) == 1:
        return list(named), []
    least, most = min(factors), max(factors)
    how = f"{most}" if least == most else f"{least} to {most}"
    trials = f"the {len(named)} trials have" if len(named) > 1 else "the trial has"
    return kept, [
        f"{trials} {total} rows: readings are averaged over {how} rows each, which leaves {left}; "
        f"commands are kept to {100.0 * off:.1g} % of their range. What is faster "
        "than that is not looked for: cut the log to the part that matters if you need it"
    ]


def _rate(trial: Trial) -> float:
    """Rows a second."""
    return 1.0 / float(np.median(np.diff(trial.time)))


def _factor(rate: float, wanted: int) -> int:
    """Rows of a block: as wanted, or as many fewer (to half) as the lines of mains ask for."""
    most = max(1, min(wanted, int(rate / LEAST_RATE_HZ)))
    tried = range(most, most // 2, -1)
    passed = [_undetectable(rate, factor) for factor in tried]
    clear = [factor for factor, share in zip(tried, passed, strict=True) if share <= LINE_PASSES]
    return clear[0] if clear else tried[int(np.argmin(passed))]


def _undetectable(rate: float, factor: int) -> float:
    """Largest share of a line of mains that averages leave where it is not looked for.

    Args:
        rate: rows a second (Hz).
        factor: rows of a block.
    """
    at = (np.arange(factor) - (factor - 1) / 2.0) / rate
    lines = [mains * harmonic for mains in MAINS_HZ for harmonic in HARMONICS]
    return max(
        abs(float(_weights(factor) @ np.cos(2.0 * np.pi * hertz * at)))
        if is_detectable(hertz, rate, NEAR_NYQUIST_HZ)
        and not is_detectable(hertz, rate / factor, NEAR_NYQUIST_HZ)
        else 0.0
        for hertz in lines
    )


def _unseen(named: Sequence[NamedTrial]) -> float:
    """By which share of its span a command may be off without any reading showing it."""
    shares = []
    for name in {name for each in named for name in each.trial.measurements}:
        parts = [each.trial.measurements[name] for each in named if name in each.trial.measurements]
        known = np.concatenate(parts)
        known = known[np.isfinite(known)]
        if known.size and np.ptp(known) > 0.0:
            shares.append(level_of_neighbours(parts) / float(np.ptp(known)))
    return min([CURVATURE, *(UNSEEN * share for share in shares if share > 0.0)])


def _fewer(trial: Trial, factor: int, off: float) -> Trial:
    """A trial with a reading for each block of rows, at the block's middle in time.

    Args:
        trial: the trial.
        factor: rows of a block.
        off: by which share of its span a command may change.
    """
    blocks = len(trial) // factor
    inner = np.arange(blocks * factor).reshape(blocks, factor)
    middles = _middles(trial.time[inner])
    extra = _bends(trial, middles, off)
    time = np.unique(np.concatenate([trial.time[:1], middles, trial.time[extra]]))
    commands = {name: _interpolated(trial.time, row, time) for name, row in trial.commands.items()}
    at = np.searchsorted(time, middles)
    measurements = {}
    for name, row in trial.measurements.items():
        measurements[name] = np.full(time.size, np.nan)
        # A block with a gap has no middle of its own: NaN stays.
        measurements[name][at] = _without_jumps(row[inner], level_of_neighbours([row]))
    kept = {"provenance": trial.provenance, "memory_at_start": trial.memory_at_start}
    return Trial(time, commands, measurements, **kept)


def _without_jumps(blocks: Array, level: float) -> Array:
    """Readings at the middle of blocks, shape (blocks,), NaN where a rare one jumps.

    Args:
        blocks: readings, shape (blocks, rows).
        level: standard deviation of their noise.
    """
    count = blocks.shape[1]
    middles = blocks @ _weights(count)
    along = np.linspace(-1.0, 1.0, count)
    basis = np.linalg.qr(np.stack([along**0, along, along**2], axis=1)[:, : min(3, count - 1)])[0]
    off = np.sqrt(np.mean((blocks - (blocks @ basis) @ basis.T) ** 2, axis=1))
    jumps = off > JUMP * level
    return np.where(jumps & (np.mean(jumps) < RARE), np.nan, middles)


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


def _bends(trial: Trial, times: Array, share: float) -> NDArray[np.int64]:
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
            off = np.abs(drawn - values) > share * span
            if not off.any():
                break
            added = np.flatnonzero(off)
            needed.update(added.tolist())
            knots = np.unique(np.concatenate([knots, trial.time[added]]))
    return np.array(sorted(needed), np.int64)
