"""Motions to follow that are no single line: pieces of lines, smooth curves, drawn ones.

All arithmetic is + - * and whole numbers, and random numbers come from a counter, so that a motion
has the same bits on every machine and for one time as for many.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.random import philox, sine_cosine, uniform

EARLY_S = 1e-9
"""How much before its time a piece begins (s): times come as multiples of a rounded period."""

KNOT_S = 1.0 / 64.0
"""Time between the knots of a smooth motion (s)."""


@dataclass(frozen=True)
class Pieces:
    """Lines one after the other, which jump where they do not meet.

    Attributes:
        starts: when each begins (s), increasing; the first holds before its time too.
        positions: where each begins (m or rad).
        speeds: speed of each (m/s or rad/s).

    >>> Pieces((0.0, 1.0), (0.0, 2.0), (2.0, -1.0))(np.array([0.5, 1.0, 1.5])).tolist()
    [1.0, 2.0, 1.5]
    """

    starts: tuple[float, ...]
    positions: tuple[float, ...]
    speeds: tuple[float, ...]

    def __call__(self, time: Any) -> Any:  # noqa: ANN401
        """Position at one time or at many (s)."""
        if isinstance(time, float):
            i = max(bisect_right(self.starts, time + EARLY_S) - 1, 0)
            return self.positions[i] + self.speeds[i] * (time - self.starts[i])
        starts, positions, speeds = self._arrays
        piece = np.maximum(np.searchsorted(starts, time + EARLY_S, side="right") - 1, 0)
        return positions[piece] + speeds[piece] * (time - starts[piece])

    @cached_property
    def _arrays(self) -> tuple[NDArray[np.float64], ...]:
        return np.array(self.starts), np.array(self.positions), np.array(self.speeds)


@dataclass(frozen=True)
class Smooth:
    """A cubic between each two knots, with the knots' positions and speeds.

    Attributes:
        positions: at k / 64 s (m or rad).
        speeds: there (m/s or rad/s).
    """

    positions: tuple[float, ...] = field(repr=False)
    speeds: tuple[float, ...] = field(repr=False)

    def __call__(self, time: Any) -> Any:  # noqa: ANN401
        """Position at one time or at many (s)."""
        last = len(self.positions) - 2
        if isinstance(time, float):
            i = min(max(int(time / KNOT_S), 0), last)
            known = self.positions[i], self.positions[i + 1], self.speeds[i], self.speeds[i + 1]
            return _cubic(time / KNOT_S - i, *known)
        positions, speeds = self._arrays
        at = np.clip((time / KNOT_S).astype(int), 0, last)
        known = positions[at], positions[at + 1], speeds[at], speeds[at + 1]
        return _cubic(time / KNOT_S - at, *known)

    @cached_property
    def _arrays(self) -> tuple[NDArray[np.float64], ...]:
        return np.array(self.positions), np.array(self.speeds)


def _cubic(share: Any, start: Any, end: Any, speed: Any, end_speed: Any) -> Any:  # noqa: ANN401
    """Hermite's cubic at a share of the way between two knots."""
    rise, first, last = end - start, KNOT_S * speed, KNOT_S * end_speed
    quadratic = 3.0 * rise - 2.0 * first - last
    return start + share * (first + share * (quadratic + share * (first + last - 2.0 * rise)))


def triangle(stroke: float, period: float, periods: int) -> Pieces:
    """Up to a stroke (m or rad) and back in each period (s), at one speed."""
    count, half = 2 * periods, 0.5 * period
    return Pieces(
        tuple(k * half for k in range(count)),
        tuple(stroke * (k % 2) for k in range(count)),
        tuple(stroke / half * (1 - 2 * (k % 2)) for k in range(count)),
    )


@dataclass(frozen=True)
class Tones:
    """A sum of sines: mean + sum_k a_k sin(2 pi (f_k t + p_k)).

    Attributes:
        mean: mean position (m or rad).
        amplitudes: a_k (m or rad).
        frequencies: f_k (Hz).
        turns: p_k, phases in turns.
    """

    mean: float
    amplitudes: tuple[float, ...]
    frequencies: tuple[float, ...]
    turns: tuple[float, ...]

    def at(self, time: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions (m or rad) and speeds at times (s), shape of time each."""
        position, speed = np.full(time.shape, self.mean), np.zeros(time.shape)
        tones = zip(self.amplitudes, self.frequencies, self.turns, strict=True)
        for amplitude, frequency, turn in tones:
            turned = frequency * time + turn
            sine, cosine = sine_cosine(turned - np.floor(turned))
            position = position + amplitude * sine
            speed = speed + amplitude * frequency * 2.0 * np.pi * cosine
        return position, speed

    def scaled(self, low: float, high: float, fastest: float, duration: float) -> "Tones":
        """The same shape between two positions, less wide where it would be too fast.

        Args:
            low: lowest position (m or rad).
            high: highest.
            fastest: greatest speed (m/s or rad/s).
            duration: over how long (s).
        """
        position, speed = self.at(_knots(duration))
        least, most = float(position.min()), float(position.max())
        factor = min((high - low) / (most - least), fastest / float(np.abs(speed).max()))
        middle = 0.5 * (low + high) - factor * (0.5 * (least + most) - self.mean)
        amplitudes = tuple(factor * amplitude for amplitude in self.amplitudes)
        return Tones(middle, amplitudes, self.frequencies, self.turns)

    def ramped(self, rise: float, duration: float) -> Smooth:
        """The tones, faded in from rest at 0 over a time (s), without a jump of speed or its rate.

        The factor is 10 s^3 - 15 s^4 + 6 s^5 of the share s of that time.
        """
        time = _knots(duration)
        share = np.minimum(time / rise, 1.0)
        factor = share * share * share * (10.0 + share * (6.0 * share - 15.0))
        slope = 30.0 * share * share * (1.0 - share) * (1.0 - share) / rise
        position, speed = self.at(time)
        speeds = factor * speed + slope * position
        return Smooth(tuple((factor * position).tolist()), tuple(speeds.tolist()))


def _knots(duration: float) -> NDArray[np.float64]:
    """Times of the knots of a trial (s), and some beyond its end."""
    return np.arange(round(duration / KNOT_S) + 4) * np.float64(KNOT_S)


def multisine(frequencies: Sequence[float], seed: int) -> Tones:
    """Tones of unit amplitude times 1 / f, each beginning at a random turn."""
    turns = shares(seed, 0, len(frequencies)).tolist()
    amplitudes = tuple(1.0 / frequency for frequency in frequencies)
    return Tones(0.0, amplitudes, tuple(frequencies), tuple(turns))


def levels(
    seed: int, low: float, high: float, least: float, most: float, duration: float
) -> Pieces:
    """Random positions, held for 1 to 2 s each, after half a second at 0.

    The first step leads up into the range. Each after it goes up or down at random, the other way
    where it would leave the range.

    Args:
        seed: of the random numbers.
        low: lowest position, once it was reached (m or rad).
        high: highest.
        least: smallest step (m or rad).
        most: largest; at least `low`, and less than half of the range.
        duration: of the trial (s).
    """
    drawn = iter(shares(seed, 1, 256).tolist())
    starts, positions, now = [0.0], [0.0], 0.5
    while now < duration - 0.5:
        before, up = positions[-1], next(drawn) < 0.5
        size = least + next(drawn) * (most - least)
        if before == 0.0:
            position = low + (size - least) * (most - low) / (most - least)
        elif (before + size <= high) if up else (before - size < low):
            position = before + size
        else:
            position = before - size
        starts.append(now)
        positions.append(position)
        now = now + 1.0 + _hundredths(next(drawn))
    return Pieces(tuple(starts), tuple(positions), (0.0,) * len(starts))


def ways(
    seed: int, low: float, high: float, slowest: float, fastest: float, duration: float
) -> Pieces:
    """Random speeds, held for 0.8 to 2 s each, from 0 on.

    The first piece leads up into the range. Each after it goes up or down at random, the other way
    where less than 0.8 s would be left, and no further than to the end of the range.

    Args:
        seed: of the random numbers.
        low: lowest position, once it was reached (m or rad).
        high: highest.
        slowest: least speed either way (m/s or rad/s).
        fastest: greatest; less than (high - low) / 1.6 s.
        duration: of the trial (s).
    """
    drawn = iter(shares(seed, 2, 512).tolist())

    def speed() -> float:
        return slowest + next(drawn) * (fastest - slowest)

    starts, positions, speeds = [0.0], [0.0], [speed()]
    now = _hundredths((low + 0.5 * next(drawn) * (high - low)) / speeds[0])
    while now < duration:
        position = positions[-1] + speeds[-1] * (now - starts[-1])
        pace, up = speed(), next(drawn) < 0.5
        room = high - position if up else position - low
        if room < 0.8 * pace:
            up, room = not up, high - low - room
        longest = 0.8 + 1.2 * next(drawn)
        starts.append(now)
        positions.append(position)
        speeds.append(pace if up else -pace)
        now = now + _hundredths(min(longest, room / pace))
    return Pieces(tuple(starts), tuple(positions), tuple(speeds))


def _hundredths(time: float) -> float:
    """A time in whole hundredths of a second, not longer."""
    return int(100.0 * time) / 100.0


def shares(seed: int, stream: int, count: int) -> NDArray[np.float64]:
    """Random numbers between 0 and 1 by seed and stream, shape (count,)."""
    nothing = np.zeros(count, np.uint64)
    counter = np.arange(count, dtype=np.uint64), nothing + np.uint64(stream), nothing, nothing
    key = np.uint64(seed & 0xFFFFFFFF), np.uint64(seed >> 32 & 0xFFFFFFFF)
    return uniform(philox(counter, key)[0])
