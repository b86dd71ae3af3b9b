"""A driven axis with dry friction, by Runge-Kutta steps that end where it sticks or breaks away."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.hidden_effects.rigs.laws import HiddenEffect, summed
from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.simulators.drive import Drive, Transmission

Array = np.ndarray

Source = Callable[[int, float], float]
"""Command of a row (N, N m) from its number and the position in the row before it (m, rad)."""

LONGEST = 1e-3
"""Longest step (s)."""

STRIBECK_STEPS = 0.2e-3
"""Longest step where friction falls with speed (s)."""

HALVINGS = 40
"""Of an interval in which an event lies."""

EVENTS = 60
"""Of one step, beyond which the axis counts as stuck for the rest of it."""


@dataclass(frozen=True)
class Motion:
    """Motion of an axis, at the rows of a log.

    Attributes:
        time: (s), shape (rows,) as all of them.
        q: position (m, rad).
        v: speed.
        a: acceleration just after the row.
        command: of the drive (N, N m).
    """

    time: Array
    q: Array
    v: Array
    a: Array
    command: Array


class Axis:
    """Equation of motion of one rig with what it hides.

    Args:
        rig: the rig.
        effects: hidden ones.
    """

    def __init__(self, rig: Rig, effects: tuple[HiddenEffect, ...]) -> None:
        self.rig = rig
        self.extra, self.kinetic, self.static = summed(effects)
        self.falling = any(getattr(each, "rise", 0.0) for each in effects)

    def pull(self, q: float, v: float, u: float) -> float:
        """All forces but dry friction (N, N m)."""
        rig = self.rig
        weight = rig.gravity * math.sin(q + rig.gravity_angle) if rig.gravity else 0.0
        return u - rig.damping * v - rig.stiffness * q - weight + self.extra(q, v, u)

    def acceleration(self, q: float, v: float, u: float, sign: float) -> float:
        """While it slips in the direction of a sign; 0 for none."""
        pull = self.pull(q, v, u)
        if sign:
            pull -= sign * self.kinetic(q, v, u)
        return pull / self.rig.inertia

    def direction(self, q: float, u: float) -> float:
        """Direction in which it leaves a stop; 0 where it sticks."""
        pull = self.pull(q, 0.0, u)
        level = self.static(q, u)
        if abs(pull) <= level:
            return 0.0
        return 1.0 if pull > 0.0 else -1.0


def simulate(
    rig: Rig,
    effects: tuple[HiddenEffect, ...],
    transmission: Transmission,
    source: Source,
    rows: int,
    start: tuple[float, float] = (0.0, 0.0),
) -> Motion:
    """The motion under commands that are joined linearly from row to row.

    Args:
        rig: the rig.
        effects: what it hides.
        transmission: of the drive.
        source: of the commands.
        rows: of the log.
        start: position and speed.
    """
    axis, interval = Axis(rig, effects), 1.0 / rig.rate
    longest = transmission.longest(STRIBECK_STEPS if axis.falling else LONGEST)
    drive = Drive(transmission, interval)
    state, (q, v) = _Contact(axis, drive), start
    table = np.empty((rows, 4))
    command = source(0, q)
    drive.begin(command)
    for row in range(rows):
        if row:
            command = source(row, q)
            drive.push(command)
            for start_, end in pairwise(drive.edges):
                steps = math.ceil((end - start_) / longest - 1e-9)
                step = (end - start_) / steps
                for i in range(steps):
                    q, v = state.advance(q, v, start_ + i * step, step)
        table[row] = q, v, state.acceleration(q, v, interval if row else 0.0), command
    return Motion(np.arange(rows) * interval, *table.T)


class _Contact:
    """Whether an axis slips, and which way; takes steps that end at events."""

    def __init__(self, axis: Axis, drive: Drive) -> None:
        self.axis, self.drive = axis, drive

    def acceleration(self, q: float, v: float, time: float) -> float:
        u = self.drive.at(time)
        sign = _sign(v) or self.axis.direction(q, u)
        if not sign and self.axis.static(q, u) > 0.0:
            return 0.0
        return self.axis.acceleration(q, v, u, sign)

    def advance(self, q: float, v: float, time: float, step: float) -> tuple[float, float]:
        """Position and speed a step later."""
        left = step
        for _ in range(EVENTS):
            if left <= 1e-12 * step:
                return q, v
            start = time + step - left
            sign = _sign(v) or self.axis.direction(q, self.drive.at(start))
            if not sign and self.axis.static(q, self.drive.at(start)) > 0.0:
                wait = self._until_it_breaks(q, start, left)
                left -= wait
                if wait < 1e-12 * step:
                    # Numbers so near the level that rounding decides: stay for this step.
                    return q, 0.0
                continue
            q, v, took = self._slip(q, v, sign, start, left)
            left -= took
        return q, 0.0

    def _slip(
        self, q: float, v: float, sign: float, time: float, step: float
    ) -> tuple[float, float, float]:
        """A step while it slips, at most until it stops; what it took (s)."""
        end = self._step(q, v, sign, time, step)
        # Where the drive's force is none, so may be the friction at that end of the step.
        ends = (q, self.drive.at(time)), (end[0], self.drive.at(time + step))
        if not any(self.axis.static(*each) > 0.0 for each in ends) or end[1] * sign >= 0.0:
            return *end, step
        low, high = 0.0, step
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if self._step(q, v, sign, time, middle)[1] * sign > 0.0:
                low = middle
            else:
                high = middle
        if high < 1e-9 * step:
            return q, 0.0, high
        return self._step(q, v, sign, time, high)[0], 0.0, high

    def _step(self, q: float, v: float, sign: float, time: float, h: float) -> tuple[float, float]:
        """Classical Runge-Kutta step of order 4."""
        go, at = self.axis.acceleration, self.drive.at
        u0, u1, u2 = at(time), at(time + 0.5 * h), at(time + h)
        a1 = go(q, v, u0, sign)
        v2 = v + 0.5 * h * a1
        a2 = go(q + 0.5 * h * v, v2, u1, sign)
        v3 = v + 0.5 * h * a2
        a3 = go(q + 0.5 * h * v2, v3, u1, sign)
        v4 = v + h * a3
        a4 = go(q + h * v3, v4, u2, sign)
        q_end = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
        return q_end, v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)

    def _until_it_breaks(self, q: float, time: float, left: float) -> float:
        """How long it still sticks, at most what is left (s)."""
        if not self.axis.direction(q, self.drive.at(time + left)):
            return left
        low, high = 0.0, left
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if self.axis.direction(q, self.drive.at(time + middle)):
                high = middle
            else:
                low = middle
        return high


def _sign(v: float) -> float:
    return float(v > 0.0) - float(v < 0.0)
