"""Project nuisances (zeros, lines, drift) out of whitened differences, in the fits of all models.

A line has a free amplitude and phase in every trial, a free zero any value. A drift is random: slow
waves whose sizes are normal numbers of known variance. With whitened columns W of variances V the
covariance of whitened readings is I + W V W^T; multiplying by its inverse root makes them white
again (generalised least squares). What repeats from trial to trial keeps most of its weight so;
what differs between trials like a drift loses it.
"""

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.preparation.noise import Whitening
from pma_gym.discovery.thresholds import LEAST_HALVES, MOST_HALVES, MOST_TURNS, SLOW_SHARE, WANDER
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

STEADY = 0.25
"""Half turns by which a line's frequency may be off in a trial and leave a fifth of it."""

LEAKS = 2
"""Half turns beyond those that a line's wandering may have."""

MOST_BYTES = 2**27
"""Memory of the projections that are kept: candidates of one diagnosis share them."""

LEAST_PART = 1e-6
"""Part of a column, or of a probe's change, that others must leave, or it is one of theirs."""


@dataclass(frozen=True)
class Projection:
    """A symmetric matrix I - Q^T diag(loss) Q that makes whitened readings white again.

    Attributes:
        basis: Q, orthonormal rows, shape (k, rows).
        loss: 1 for what is projected out, less for what is known beforehand, shape (k,).
        raw: nuisances (SI) of the rows of `basis`, shape (k, rows).
        shrunk: share of each that is its best prediction, shape (k,).
    """

    basis: Array
    loss: Array
    raw: Array
    shrunk: Array

    def out_of(self, white: Array) -> None:
        """Project nuisances out of whitened columns, shape (columns, rows), in place."""
        white -= ((white @ self.basis.T) * self.loss) @ self.basis

    def predicted(self, white: Array) -> Array:
        """The best prediction of the nuisances (SI) in whitened readings, shape (rows,)."""
        return ((self.basis @ white) * self.shrunk) @ self.raw


_made: OrderedDict[tuple[Whitening, bool, bytes], Projection] = OrderedDict()
_lock = Lock()


def projection(noise: Whitening, logged: Logged, channel: int, free_zero: bool) -> Projection:
    """How nuisances are projected out of one signal of a trial; the latest are kept.

    Args:
        noise: of the signal.
        logged: the trial.
        channel: the signal.
        free_zero: whether its zero is free.
    """
    parts = (logged.time, logged.motor, logged.regulator, logged.missing[channel])
    key = noise, free_zero, sha256(b"".join(map(np.ndarray.tobytes, parts))).digest()
    with _lock:
        known = _made.get(key)
    if known is None:
        known = _project(noise, logged, channel, free_zero)
        with _lock:
            _made[key] = known
            while sum(each.basis.nbytes + each.raw.nbytes for each in _made.values()) > MOST_BYTES:
                _made.popitem(last=False)
    return known


def _project(noise: Whitening, logged: Logged, channel: int, free_zero: bool) -> Projection:
    """As `projection`, made anew."""
    time, missing = logged.time - logged.time[0], logged.missing[channel]
    free = [np.ones(len(time))] if free_zero else []
    for hertz in noise.lines:
        free += line_columns(hertz, time)
    known: list[Array] = []
    if noise.drift > 0.0:
        known = [noise.drift * each for each in drift_columns(logged, noise.waves)]
        if not free_zero:
            known.append(np.full(len(time), noise.drift))

    def white(columns: list[Array]) -> Array:
        rows = np.reshape(columns, (-1, len(time))).copy()
        rows[:, missing] = 0.0
        return noise.white(rows, missing)

    return _projection(free, known, white)


def _projection(
    free: list[Array], known: list[Array], white: Callable[[list[Array]], Array]
) -> Projection:
    """From columns of free size and columns of unit variance (SI)."""
    rows = white([*free, *known])
    left, sizes, right = np.linalg.svd(rows[: len(free)], full_matrices=False)
    kept = sizes > LEAST_PART * sizes.max(initial=0.0)
    basis = right[kept]
    raw = (left[:, kept].T / sizes[kept, None]) @ np.reshape(free, (-1, rows.shape[1]))
    loss, shrunk = np.ones(len(basis)), np.ones(len(basis))
    if known:
        across = rows[len(free) :] @ basis.T
        rest = rows[len(free) :] - across @ basis
        own = np.reshape(known, (-1, rows.shape[1])) - across @ raw
        left, sizes, right = np.linalg.svd(rest, full_matrices=False)
        kept = sizes > LEAST_PART * max(sizes.max(initial=0.0), 1.0)
        basis = np.concatenate([basis, right[kept]])
        raw = np.concatenate([raw, (left[:, kept].T / sizes[kept, None]) @ own])
        strength = sizes[kept] ** 2
        loss = np.append(loss, 1.0 - 1.0 / np.sqrt(1.0 + strength))
        shrunk = np.append(shrunk, strength / (1.0 + strength))
    return Projection(basis, loss, raw, shrunk)


def line_columns(hertz: float, time: Array) -> list[Array]:
    """Cosine and sine of a line; of a long trial also with slow modulation, since mains wander.

    Args:
        hertz: its mean frequency.
        time: of the rows (s), shape (rows,), from the first on.
    """
    duration = max(float(time[-1] - time[0]), 1e-300)
    turns = min(math.ceil(max(2.0 * WANDER * hertz * duration - STEADY, 0.0)), MOST_TURNS)
    # What is no whole number of half turns leaks into the next ones.
    turns += LEAKS if turns else 0
    slow = [np.cos(np.pi * k * (time - time[0]) / duration) for k in range(turns + 1)]
    angle = 2.0 * np.pi * hertz * time
    return [each * wave for each in slow for wave in (np.cos(angle), np.sin(angle))]


def drift_columns(logged: Logged, waves: int = 0) -> list[Array]:
    """Slow cosines and sines of a drift, of mean square 1 in all, less the faster they are.

    A cosine of half periods has no slope where a trial begins and ends; a drift has. Cosines alone
    leave up to 60 % of a wave of 0.5 to 1.5 periods a trial; with sines beside them it is 0.5 %.

    Args:
        logged: the trial.
        waves: least number of half periods, as repeats tell.
    """
    time = logged.time - logged.time[0]
    turns = np.pi * time / max(float(time[-1]), 1e-300)
    count = max(half_periods(logged), waves)
    sizes = 1.0 / np.arange(1, count + 1)
    sizes /= np.sqrt(np.sum(sizes**2))
    return [
        size * wave(k * turns)
        for k, size in zip(range(1, count + 1), sizes.tolist(), strict=True)
        for wave in (np.cos, np.sin)
    ]


def half_periods(logged: Logged) -> int:
    """Most half periods that a drift has in a trial, as its commands leave them free."""
    duration = float(logged.time[-1] - logged.time[0])
    most = int(duration * slowest_hertz(logged) + 1e-9)
    return int(np.clip(most, LEAST_HALVES, MOST_HALVES))


def slowest_hertz(logged: Logged) -> float:
    """The slowest frequency (Hz) that the commands of a trial excite, at least one period."""
    slowest = np.inf
    duration = float(logged.time[-1] - logged.time[0])
    for command in (logged.motor, logged.regulator):
        power = np.abs(np.fft.rfft(command - command.mean())) ** 2
        if power.sum() > 1e-12 * len(command) * float(np.sum(command**2) + 1e-300):
            shares = np.cumsum(power) / power.sum()
            slowest = min(slowest, int(np.searchsorted(shares, SLOW_SHARE)) / duration)
    return max(slowest, 1.0 / duration) if np.isfinite(slowest) else 1.0 / duration
