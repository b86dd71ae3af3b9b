"""From the logged command to the force: line between rows, delay, lag, dead band, gain by sign."""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import cast

from scipy.optimize import brentq

NEAR = 1e-9
"""Share of an interval within which two bends are one."""


@dataclass(frozen=True)
class Transmission:
    """Transmission from a drive's command.

    Attributes:
        delay: the force comes so much later (s).
        lag: time constant of a first-order lag (s); 0 without.
        forward: gain of positive commands.
        backward: gain of negative commands.
        dead: what the drive takes off the amount of every command (N, N m).
    """

    delay: float = 0.0
    lag: float = 0.0
    forward: float = 1.0
    backward: float = 1.0
    dead: float = 0.0

    def longest(self, step: float) -> float:
        """The longest step (s) of those up to a given one that a lag's decay is smooth in."""
        return min(step, 0.2 * self.lag) if self.lag else step


@dataclass
class Drive:
    """The force between rows, for commands that are joined linearly.

    `push` tells the command of the next row; `at` is the force within the interval that it ends.
    Before the first row the command is that of the first row.

    Attributes:
        transmission: of the drive.
        interval: between rows (s).
        edges: times within it (s), 0 and its end among them, between which the force is smooth: a
            late command bends, and the force's slope jumps where the command changes its sign or
            leaves the dead band.
    """

    transmission: Transmission
    interval: float
    edges: list[float] = field(default_factory=list)
    _late: list[float] = field(default_factory=list)
    _commands: list[float] = field(default_factory=list)
    _lagged: float = 0.0
    _whole: int = 0
    _part: float = 0.0

    def begin(self, command: float) -> None:
        """The command of the first row, which has been there for long."""
        self._commands, self._lagged = [command], command
        rows = self.transmission.delay / self.interval
        self._whole, self._part = math.floor(rows), rows - math.floor(rows)
        self._late = [command, command, command]

    def push(self, command: float) -> None:
        """The command of the next row."""
        if len(self._commands) > 1:
            self._lagged = self._passed(self.interval)
        self._commands.append(command)
        rows = [len(self._commands) - 1 - self._whole - each for each in (2, 1, 0)]
        self._late = [self._commands[max(row, 0)] for row in rows]
        self.edges = self._edges()

    def _edges(self) -> list[float]:
        span, dead = self.interval, self.transmission.dead
        bends = [0.0, self._part * span, span]
        crossings = [
            cast(float, brentq(lambda t, level=level: self._passed(t) - level, start, end))
            for start, end in pairwise(bends)
            for level in {0.0, dead, -dead}
            if (self._passed(start) - level) * (self._passed(end) - level) < 0.0
        ]
        edges = [0.0]
        for edge in sorted([*bends, *crossings]):
            if edge - edges[-1] > NEAR * span:
                edges.append(edge)
        edges[-1] = span
        return edges

    def halves(self, start: float, end: float) -> tuple[float, float]:
        """Mean force over a part of the interval with weights that fall from 1 to 0, and that rise.

        Each is half of the mean for a force that does not change.
        """
        inner = [edge for edge in self.edges if start < edge < end]
        falls = rises = 0.0
        for a, b in pairwise([start, *inner, end]):
            for time, weight in ((a, 1.0), (0.5 * (a + b), 4.0), (b, 1.0)):
                part = weight * (b - a) / 6.0 * self.at(time) / (end - start)
                share = (time - start) / (end - start)
                falls += (1.0 - share) * part
                rises += share * part
        return falls, rises

    def at(self, time: float) -> float:
        """Force (N, N m) so many seconds after the row before the last."""
        return self._gained(self._passed(time))

    def _passed(self, time: float) -> float:
        """What has passed delay and lag by then; the gain goes by its sign, between rows too."""
        part = self._part
        before, start, end = self._late
        span, lag = self.interval, self.transmission.lag
        if not part:
            return _line(start, end, time / span, self._lagged, lag, span)
        # The bend of a late command lies within the interval.
        breakpoint = part * span
        first = start + (before - start) * part
        if time <= breakpoint:
            return _lagged(first, (start - before) / span, time, self._lagged, lag)
        at_breakpoint = _lagged(first, (start - before) / span, breakpoint, self._lagged, lag)
        return _lagged(start, (end - start) / span, time - breakpoint, at_breakpoint, lag)

    def _gained(self, command: float) -> float:
        gain = self.transmission.forward if command > 0.0 else self.transmission.backward
        if self.transmission.dead:
            command = math.copysign(max(abs(command) - self.transmission.dead, 0.0), command)
        return gain * command


def _line(start: float, end: float, share: float, lagged: float, lag: float, span: float) -> float:
    if not lag:
        return start + (end - start) * share
    return _lagged(start, (end - start) / span, share * span, lagged, lag)


def _lagged(start: float, slope: float, time: float, lagged: float, lag: float) -> float:
    """Exact response of a first-order lag to a ramp, from the value that it had at its start."""
    if not lag:
        return start + slope * time
    settled = start - slope * lag
    return settled + slope * time + (lagged - settled) * math.exp(-time / lag)
