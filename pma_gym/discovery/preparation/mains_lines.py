"""Find mains lines (50 or 60 Hz, harmonics, and their aliases) in what a refitted model leaves.

A line is looked for at no other frequency, against the residual beside it, and is fitted together
with every candidate afterwards. Where its alias lies in the band that commands excite, it is not
looked for: there it could be the rig.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from pma_gym.discovery.preparation.noise import Whitening
from pma_gym.discovery.thresholds import LEAST_ALIAS_HZ, LEAST_HARMONIC, LINE_CHANCE, SLIGHT, WANDER
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

MAINS_HZ, HARMONICS = (50.0, 60.0), (1, 2, 3, 4, 5, 6)
"""Nominal frequencies of mains, and which multiples are looked for."""

FARTHEST_HZ, STEPS = 0.2, (8, 400)
"""How far the frequency of mains may be off (Hz), in at least and at most so many steps."""

TURN = 0.5
"""Turns by which a step of the frequency lets a wave gain on another over a trial: a step of a
whole one passes a line by."""

BESIDE_HZ = np.array([-2.5, -2.1, -1.7, -1.3, 1.3, 1.7, 2.1, 2.5])
"""Where the residual beside a line is taken (Hz from it)."""

SAME_HZ = 1e-9
"""Difference of two frequencies that are one (Hz): rounding."""

SLOW = 6
"""Powers of the time, from 0 on, that are slow."""

FINER = 41
"""Frequencies that are tried about the best of those steps."""


def with_lines(
    noise: Sequence[Whitening], logged: Sequence[Logged], left: Sequence[Array]
) -> tuple[Whitening, ...]:
    """Whitening with the lines that stand in a residual; levels are those beside them.

    Args:
        noise: of the signals.
        logged: the trials.
        left: simulated less measured (SI), NaN where not measured, shape (signals, rows) each.
    """
    left = [
        np.stack([_without_slow(trial.time, row) for row in part])
        for part, trial in zip(left, logged, strict=True)
    ]
    lines: list[list[float]] = [[] for _ in noise]
    powers = np.zeros(len(noise))
    for mains in MAINS_HZ:
        base, named = _frequency(mains, noise, logged, left), [False] * len(noise)
        for harmonic in HARMONICS:
            for channel, each in enumerate(noise):
                hertz = harmonic * base
                if any(abs(hertz - other) < SAME_HZ for other in lines[channel]):
                    continue
                size, chance = _line(hertz, logged, [part[channel] for part in left])
                least = LEAST_HARMONIC if named[channel] else SLIGHT
                if chance < LINE_CHANCE and size > least * each.level:
                    lines[channel].append(hertz)
                    powers[channel] += size**2
                    named[channel] = True
    return tuple(
        _beside_lines(each, lines[channel], powers[channel]) if lines[channel] else each
        for channel, each in enumerate(noise)
    )


def _beside_lines(noise: Whitening, lines: Sequence[float], power: float) -> Whitening:
    """Noise beside its lines, which were in its level as it was known, and in its colour."""
    level = float(np.sqrt(max(noise.level**2 - power, 0.25 * noise.level**2)))
    return replace(noise, coefficients=(), innovation=level, level=level, lines=tuple(lines))


def _frequency(
    mains: float, noise: Sequence[Whitening], logged: Sequence[Logged], left: Sequence[Array]
) -> float:
    """The frequency near that of mains at which all residuals have most power."""

    def power(hertz: float) -> float:
        total = 0.0
        for channel, each in enumerate(noise):
            for part, trial in zip(left, logged, strict=True):
                if np.isfinite(part[channel]).any():
                    at = np.array([hertz])
                    total += _power(at, trial.time, part[channel]) / each.level**2
        return total

    longest = max(float(trial.time[-1] - trial.time[0]) for trial in logged)
    steps = int(np.clip(2.0 * FARTHEST_HZ * longest / TURN, *STEPS))
    tried = mains + np.linspace(-FARTHEST_HZ, FARTHEST_HZ, steps + 1)
    best = float(tried[np.argmax([power(hertz) for hertz in tried])])
    # What is off by an eighth of a turn still leaves a quarter of a line.
    near = best + (tried[1] - tried[0]) * np.linspace(-1.0, 1.0, FINER)
    return float(near[np.argmax([power(hertz) for hertz in near])])


def is_detectable(hertz: float, rate: float, beside: float) -> bool:
    """Whether a line's alias lies above what commands excite, and below half the rate.

    Args:
        hertz: its frequency.
        rate: readings a second (Hz).
        beside: how far below half the rate it lies at least (Hz).
    """
    alias = abs(hertz - rate * round(hertz / rate))
    return LEAST_ALIAS_HZ < alias < 0.5 * rate - beside


def line_size(hertz: float, logged: Sequence[Logged], parts: Sequence[Array]) -> float:
    """Size of a line in residuals of one signal (rms, SI)."""
    pairs = zip(parts, logged, strict=True)
    return _line(hertz, logged, [_without_slow(trial.time, part) for part, trial in pairs])[0]


def _line(hertz: float, logged: Sequence[Logged], parts: Sequence[Array]) -> tuple[float, float]:
    """Size of a line (rms, SI), and how likely the residual beside it makes one so large."""
    power, beside, count, rows = 0.0, 0.0, 0, 0
    for part, trial in zip(parts, logged, strict=True):
        known = int(np.isfinite(part).sum())
        if known < 4 * len(BESIDE_HZ):
            continue
        # Rows without a reading, which commands need, say nothing of how often one is taken.
        rate = 1.0 / float(np.median(np.diff(trial.time[np.isfinite(part)])))
        if not is_detectable(hertz, rate, 1.0 / float(trial.time[-1] - trial.time[0])):
            return 0.0, 1.0
        # In a long trial the net's own frequency is looked for, and as long beside it.
        near = _near(hertz, float(trial.time[-1] - trial.time[0]))
        power += _power(hertz + near, trial.time, part)
        beside += np.mean([_power(hertz + off + near, trial.time, part) for off in BESIDE_HZ])
        count, rows = count + 1, rows + known
    if not count or beside <= 0.0:
        return 0.0, 1.0
    ratio = power / beside
    chance = float(fisher.sf(ratio, 2 * count, 2 * count * len(BESIDE_HZ)))
    return float(np.sqrt(max(power - beside, 0.0) / rows)), chance


def _near(hertz: float, duration: float) -> Array:
    """Frequencies about a line's at which it may stand in a trial (Hz from it)."""
    off = WANDER * hertz
    steps = int(np.ceil(off * duration / TURN)) if off * duration > TURN else 0
    return np.linspace(-off, off, 2 * steps + 1) if steps else np.zeros(1)


def _power(hertz: Array, time: Array, part: Array) -> float:
    """Sum of squares (SI) that a line of free amplitude and phase explains of one trial.

    The largest of some frequencies, shape (n,).
    """
    known = np.isfinite(part)
    values, times = part[known] - part[known].mean(), time[known]
    sums = [np.exp(-2j * np.pi * each * times) @ values for each in hertz]
    return float(2.0 * np.max(np.abs(sums)) ** 2 / known.sum())


def _without_slow(time: Array, part: Array) -> Array:
    """A trial's residual of one signal less what is slow in it, shape (rows,).

    What ends otherwise than it begins has a part at every frequency.
    """
    known = np.isfinite(part)
    if known.sum() <= SLOW:
        return part
    slow = np.vander((time - time[0]) / (time[-1] - time[0]), SLOW)
    return part - slow @ np.linalg.lstsq(slow[known], part[known], rcond=None)[0]
