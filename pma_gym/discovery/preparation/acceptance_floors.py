"""What a signal's misfit is judged against before a verdict may deny missing structure.

In this order: the scatter between repeats, which holds what the rig itself does not repeat; the
tolerance that the lab gives in `dataset.toml`, or the readings' noise where that is coarser, for no
model comes closer to readings than their noise; the noise of the sensor in rest segments. A sensor
that stands still at rest, as an encoder on one count, shows no noise there: its rounding is no
floor for an open-loop simulation. Of a summary (a few readings a trial) the standard error that a
lab prints stands in the place of rest segments.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.discovery.preparation.noise import rest_readings, step_between
from pma_gym.discovery.thresholds import ENOUGH_FOR_FLOOR, LOG_ROWS, STILL, TURN_BACK
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

REPEATS, TOLERANCE, NOISE = "repeats", "tolerance", "readings' noise"
REST, ERRORS = "rest segments", "standard errors"
"""Where a floor comes from."""


@dataclass(frozen=True)
class Stated:
    """What is known of signals beside their readings (SI, by output).

    Attributes:
        tolerance: misfit that is good enough.
        standard_error: of a summary's readings.
        noise: of the readings, as it is known before a fit.
    """

    tolerance: Mapping[str, float] = field(default_factory=dict)
    standard_error: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class AcceptanceFloor:
    """The floor of one signal.

    Attributes:
        level: root mean square (SI).
        source: `repeats`, `tolerance`, `readings' noise` (of readings that have a finer tolerance),
            `rest segments` or `standard errors`.
        tolerance: that the lab gives (SI); None where it gives none.
    """

    level: float
    source: str
    tolerance: float | None = None


def acceptance_floors(
    logged: Sequence[Logged],
    named: Sequence[NamedTrial],
    stated: Stated,
    humming: Collection[str] = (),
) -> dict[str, AcceptanceFloor]:
    """The floor of every signal that has one, by output.

    Two repeats that begin at about the same phase of mains share their hum: a signal that hums
    scatters at least as much as it does at rest.

    Args:
        logged: the trials as they are read.
        named: the same, with what is known of repeats.
        stated: what the lab states, and the readings' noise.
        humming: signals that have lines of mains.
    """
    floors = {}
    for channel, signal in enumerate(logged[0].signals):
        name = signal.name
        if not any(each.measures[channel] for each in logged):
            continue
        scatter, rest = scatter_of_repeats(logged, named, channel), _rest(logged, channel)
        if scatter and name in humming:
            scatter = max(scatter, rest or 0.0)
        # What repeats itself is rounded alike each time; no simulation is.
        rounding = step_between(logged, channel) / np.sqrt(12.0)
        tolerance, noise = stated.tolerance.get(name), stated.noise.get(name, 0.0)
        for source, level in (
            (REPEATS, scatter and max(scatter, rounding)),
            (NOISE, noise if tolerance and tolerance < noise else None),
            (TOLERANCE, tolerance),
            (ERRORS, stated.standard_error.get(name)),
            (REST, rest),
        ):
            if level:
                floors[name] = AcceptanceFloor(float(level), source, tolerance)
                break
    return floors


def is_summary(parts: Sequence[Array]) -> bool:
    """Whether a signal has too few readings a trial to be a series.

    Args:
        parts: its readings or residuals in each trial, NaN where there is none.
    """
    return max((int(np.isfinite(part).sum()) for part in parts), default=0) < LOG_ROWS


def _rest(logged: Sequence[Logged], channel: int) -> float | None:
    """Noise in rest segments (SI); None where there are few readings, or where they stand still."""
    segments = [part[np.isfinite(part)] for part in rest_readings(logged, channel)]
    count = sum(len(part) for part in segments)
    if count < ENOUGH_FOR_FLOOR:
        return None
    # What still settles bends away from a line.
    squares = sum(float(np.sum(_about_parabola(part) ** 2)) for part in segments)
    level = float(np.sqrt(squares / (count - 3 * len(segments))))
    if sum(_turns(part, TURN_BACK * level) for part in segments) < STILL * count:
        return None
    return max(level, step_between(logged, channel) / np.sqrt(12.0))


def _turns(values: Array, least: float) -> int:
    """How often readings turn back, by more than the least move that counts."""
    moves = np.diff(values)
    moves = np.sign(moves[np.abs(moves) > least])
    return int(np.sum(moves[1:] != moves[:-1]))


def _about_parabola(values: Array) -> Array:
    at = np.linspace(-1.0, 1.0, len(values))
    return values - np.polynomial.Polynomial.fit(at, values, 2)(at)


def scatter_of_repeats(
    logged: Sequence[Logged], named: Sequence[NamedTrial], channel: int
) -> float | None:
    """Scatter of a signal about the mean of repeats (SI); None without repeats.

    Trials repeat each other where the data set says so, or where their times and commands are the
    same numbers. The mean of a difference counts too, but for signals whose zero is free.
    """
    squares, count = 0.0, 0
    for group in repeats(logged, named):
        for i, j in zip(group, group[1:], strict=False):
            apart = difference(logged[i], logged[j], channel)
            free = logged[i].signals[channel].has_free_zero and apart.size > 1
            # A file that was copied is no repeat.
            if apart.size and np.any(apart):
                squares += float(np.sum((apart - free * apart.mean()) ** 2)) / 2.0
                count += apart.size - free
    return float(np.sqrt(squares / count)) if count else None


def repeats(logged: Sequence[Logged], named: Sequence[NamedTrial]) -> list[list[int]]:
    """Trials that repeat each other, as groups of their places."""
    groups: dict[object, list[int]] = {}
    by_commands: dict[bytes, str] = {}
    for i, (each, trial) in enumerate(zip(logged, named, strict=True)):
        commands = b"".join(row.tobytes() for row in (each.time, each.motor, each.regulator))
        same = by_commands.setdefault(commands, trial.repeat_of or trial.name)
        groups.setdefault(trial.repeat_of or same, []).append(i)
    return [group for group in groups.values() if len(group) > 1]


def difference(one: Logged, other: Logged, channel: int) -> Array:
    """What one repeat reads beyond another (SI), shape (n,); empty where their times differ."""
    shared = min(len(one.time), len(other.time))
    if not np.array_equal(one.time[:shared], other.time[:shared]):
        return np.empty(0)
    both = other.measured[channel, :shared] - one.measured[channel, :shared]
    there = (one.counts[channel, :shared] > 0.0) & (other.counts[channel, :shared] > 0.0)
    return both[there]
