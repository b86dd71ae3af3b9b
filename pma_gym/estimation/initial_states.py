"""Initial states of a free rig's trials: estimate from the first measurements, and correction.

An error of 0.2 mm/s in the initial speed causes 0.2 mm within a second, far more than a sensor's
noise; no derivative of the first measurements is that accurate. Every trial is therefore simulated
again with another initial speed, and with another initial position if the rig defines its zero.
Linear combinations of these simulations fit the measurements. To first order this estimates the
initial position and speed together with the other parameters. Where the first estimate is so far
off that the equations bend on the way, the trial begins again from the corrected one.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import Signal
from pma_gym.data.trial import Trial
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

FIRST_S, FIRST_ROWS = 0.05, 8
"""Time (s) and smallest number of first measurements for the estimate of an initial state."""

MOVE = 1e-3
"""Differences of initial position and speed (SI)."""

BENDS, RESTARTS = 3.0, 3
"""Square of a correction, over the level of the noise times what the trial goes through, from which
on a trial begins again, and how often: that is what a bend in its equations may be off by."""

BENDING_S, LEAVES = 0.5, 0.01
"""Length (s) beyond which a trial begins again, and share of its misfit (sum of squares) that the
correction may leave: where more is left the model is wrong, and a search over lines is smoother.
Assumptions: of a pendulum's fit a quarter of the corrections left 6e-6 or less, a quarter 0.2 or
more."""


_known: WeakKeyDictionary[Trial, tuple[tuple[Signal, ...], tuple[float, float]]] = (
    WeakKeyDictionary()
)


def starts(trials: Sequence[Trial], read: Sequence[Logged]) -> tuple[Array, Array]:
    """Estimate the initial position and speed of trials (SI), shape (trials,) each.

    Args:
        trials: the trials; an estimate is kept as long as its trial, which many fits begin from.
        read: the same as they are read.
    """
    fitted = np.array(
        [_kept_start(trial, logged) for trial, logged in zip(trials, read, strict=True)]
    )
    return fitted[:, 0], fitted[:, 1]


class Correction(NamedTuple):
    """How the first of some simulations was corrected.

    Attributes:
        moves: how far its start was off, in `MOVE`, shape (further,).
        misfit: sum of squares of what it left of the readings before.
        rough: whether the start was so far off that the equations bend on the way.
    """

    moves: Array
    misfit: float
    rough: bool


def meet(
    states: Sequence[Array],
    readings: Sequence[Sequence[Array]],
    trials: Sequence[Logged],
    levels: Array,
    further: int,
) -> list[Correction]:
    """Correct simulations for their initial states, so that they fit the measurements.

    Args:
        states: of all simulations of each trial, the last of which are the first with another start
            each, shape (tried + further, rows, states); the others are changed in place.
        readings: what the sensors hold in them (SI), shape (tried + further, rows) each, by
            trial and signal.
        trials: what was measured.
        levels: standard deviations of the signals (SI), shape (signals,).
        further: how many other starts there are.
    """
    sought = [
        _Sought.of(signals, logged, levels, further)
        for signals, logged in zip(readings, trials, strict=True)
    ]
    known = [each for each in sought if np.isfinite(each.sizes).all() and each.sizes.any()]
    # What one start does as well as the other is shared between them.
    sizes = np.array([each.sizes for each in known]).reshape(-1, further, further)
    inverses = np.linalg.pinv(sizes, hermitian=True)
    by_trial = dict(zip(map(id, known), inverses, strict=True))
    return [
        _corrected(space, logged, each, float(levels[logged.channels[0]]), by_trial.get(id(each)))
        for space, logged, each in zip(states, trials, sought, strict=True)
    ]


class _Sought(NamedTuple):
    """What a correction of one trial has to explain, in units of its first signal's noise.

    Attributes:
        moves: what each other start does to the readings, shape (further, readings).
        first: the same for the first signal alone.
        deviations: measured less simulated, shape (tried, readings).
        sizes: products of the moves, shape (further, further).
    """

    moves: Array
    first: Array
    deviations: Array
    sizes: Array

    @classmethod
    def of(
        cls, readings: Sequence[Array], logged: Logged, levels: Array, further: int
    ) -> "_Sought":
        along, off = [], []
        for channel in logged.channels:
            there = logged.there[channel]
            # One signal has no weight beside another.
            weight = levels[logged.channels[0]] / levels[channel]
            read = readings[channel][:, there]
            change = weight * (read[-further:] - read[0])
            if logged.signals[channel].has_free_zero:
                change = change - change.mean(axis=1, keepdims=True)
            along.append(change)
            off.append(weight * (logged.measured[channel, there] - read[:-further]))
        one = len(along) == 1
        moves = along[0] if one else np.concatenate(along, axis=1)
        deviations = off[0] if one else np.concatenate(off, axis=1)
        # A simulation that runs away has no finite sizes; it stays as it is.
        with np.errstate(over="ignore", invalid="ignore"):
            return cls(moves, along[0], deviations, moves @ moves.T)


def _corrected(
    states: Array, logged: Logged, sought: _Sought, level: float, inverse: Array | None
) -> Correction:
    """The correction of one trial, made in its states; none where `inverse` is None."""
    moves, first, deviations, _ = sought
    further = len(moves)
    if inverse is None:
        return Correction(np.zeros(further), np.inf, False)
    shares = deviations @ moves.T @ inverse
    for share, moved in zip(shares.T, states[-further:] - states[0], strict=True):
        states[:-further] += share[:, None, None] * moved
    misfit = float(deviations[0] @ deviations[0])
    rough = False
    if logged.time[-1] - logged.time[0] > BENDING_S:
        at = logged.channels[0]
        span = float(np.ptp(logged.measured[at, logged.there[at]]))
        most = float(np.abs(shares[0] @ first).max())
        rest = deviations[0] - shares[0] @ moves
        bends = math.isfinite(most) and most**2 > BENDS * level * span
        rough = bends and float(rest @ rest) < LEAVES * misfit
    return Correction(shares[0], misfit, rough)


def put_zero(positions: Array, logged: Logged) -> None:
    """Put simulated positions on the zero of a late sensor, which read the first one earlier.

    Args:
        positions: what the sensor holds (SI), shape (tried, rows); changed in place.
        logged: what was measured; the position is its first signal.
    """
    counts = logged.counts[0]
    if counts.any():
        off = (logged.measured[0] - positions) @ counts / counts.sum()
        positions += off[:, None]


def _kept_start(trial: Trial, logged: Logged) -> tuple[float, float]:
    kept = _known.get(trial)
    if kept is None or kept[0] != logged.signals:
        kept = _known[trial] = (logged.signals, _start(logged))
    return kept[1]


def _start(logged: Logged) -> tuple[float, float]:
    speed = logged.channel("angular speed", "speed")
    if not logged.measures[0] and speed is not None and logged.measures[speed]:
        # A log of speed alone says nothing of where it began: at the position's zero.
        return 0.0, _first(logged, speed)[0]
    return _first(logged, 0)


def _first(logged: Logged, channel: int) -> tuple[float, float]:
    """A signal and its rate (SI) where a trial begins, by a parabola through its first readings."""
    there = np.arange(len(logged.time))[logged.there[channel]]
    if len(there) < 3:
        return 0.0, 0.0
    time, values = logged.time[there] - logged.time[0], logged.measured[channel, there]
    count = max(FIRST_ROWS, int(np.searchsorted(time, FIRST_S)))
    order = 2 if min(count, len(there)) > 3 else 1
    fitted = np.polynomial.Polynomial.fit(time[:count], values[:count], order)
    return float(fitted(0.0)), float(fitted.deriv()(0.0))
