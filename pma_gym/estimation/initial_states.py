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


def meet(states: Array, held: Array, logged: Logged, levels: Array, further: int) -> Correction:
    """Correct simulations for their initial states, so that they fit the measurements.

    Args:
        states: of all simulations, the last of which are the first with another start each, shape
            (tried + further, rows, states); the others are changed in place.
        held: what the sensors hold in them (SI), shape (tried + further, signals, rows).
        logged: what was measured.
        levels: standard deviations of the signals (SI), shape (signals,).
        further: how many other starts there are.
    """
    along, off = [], []
    measured = [channel for channel, known in enumerate(logged.measures) if known]
    for channel in measured:
        there = _there(logged, channel)
        # One signal has no weight beside another.
        weight = levels[measured[0]] / levels[channel]
        change = weight * (held[-further:, channel, there] - held[0, channel, there])
        if logged.signals[channel].has_free_zero:
            change = change - change.mean(axis=1, keepdims=True)
        along.append(change)
        off.append(weight * (logged.measured[channel, there] - held[:-further, channel, there]))
    moves = np.concatenate(along, axis=1)
    # A simulation that runs away has no finite sizes; it stays as it is.
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = moves @ moves.T
    if not np.isfinite(sizes).all() or not sizes.any():
        return Correction(np.zeros(further), np.inf, False)
    # What one start does as well as the other is shared between them.
    wanted = np.concatenate(off, axis=1)
    shares = wanted @ moves.T @ np.linalg.pinv(sizes, hermitian=True)
    for share, moved in zip(shares.T, states[-further:] - states[0], strict=True):
        states[:-further] += share[:, None, None] * moved
    first = measured[0]
    span = float(np.ptp(logged.measured[first, _there(logged, first)]))
    most = float(np.abs(shares[0] @ along[0]).max())
    bends = math.isfinite(most) and most**2 > BENDS * float(levels[first]) * span
    misfit, rest = float(wanted[0] @ wanted[0]), wanted[0] - shares[0] @ moves
    rough = (
        bends
        and bool(logged.time[-1] - logged.time[0] > BENDING_S)
        and float(rest @ rest) < LEAVES * misfit
    )
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
    there = np.flatnonzero(_there(logged, channel))
    if len(there) < 3:
        return 0.0, 0.0
    time, values = logged.time[there] - logged.time[0], logged.measured[channel, there]
    count = max(FIRST_ROWS, int(np.searchsorted(time, FIRST_S)))
    order = 2 if min(count, len(there)) > 3 else 1
    fitted = np.polynomial.Polynomial.fit(time[:count], values[:count], order)
    return float(fitted(0.0)), float(fitted.deriv()(0.0))


def _there(logged: Logged, channel: int) -> NDArray[np.bool_]:
    there = np.ones(len(logged.time), bool)
    there[logged.missing[channel]] = False
    return there
