"""Noise floors as a diagnosis knows them before it has fitted anything.

Sensors are the lab's: `[sensors]` of the data set states their noise and step, or rest segments
and the steps of the readings tell them. What the model says of its sensors, and the station's DAQ
for readings that keep to its levels, comes after that; last come the differences of neighbouring
readings, which know nothing of slow noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.datasets.lab_sensors import LabSensor
from pma_gym.data.quality.clipping import read_by_daq
from pma_gym.data.signals import Signal
from pma_gym.discovery.preparation.acceptance_floors import difference
from pma_gym.discovery.preparation.noise import (
    distinct_readings,
    level_at_rest,
    level_of_neighbours,
    rest_readings,
    sparse,
    step_between,
)
from pma_gym.estimation.logged import Logged
from pma_gym.plant import sensors
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

STATED, REST, MODEL, NEIGHBOURS = (
    "the lab's sensor",
    "rest segments",
    "the model's sensor",
    "neighbouring readings",
)
"""Where a level comes from, the first that there is; beside `repeats`."""

FINEST = 1e-7
"""Noise, as a share of a signal's span, that any sensor has: no smaller level makes sense of a
file's numbers."""


@dataclass(frozen=True)
class Level:
    """The noise of one signal (SI).

    Attributes:
        level: standard deviation.
        source: where it is known from.
        by_source: what each source says.
        step: smallest step between readings; 0 if none shows.
        expected_step: the step that the sensor should have: the lab's, or of readings that keep to
            its levels the DAQ's; 0 where nobody knows.
        distinct: how many readings differ from each other.
        shown: what of the level the readings show: where the model alone says it, no more than
            neighbouring readings differ by.
    """

    signal: Signal
    level: float
    source: str
    by_source: dict[str, float]
    step: float
    expected_step: float
    distinct: int
    shown: float = 0.0


def initial_floors(
    model: Model,
    logged: Sequence[Logged],
    named: Sequence[NamedTrial],
    stated: Mapping[str, LabSensor] | None = None,
) -> list[Level]:
    """Levels of the rig's signals, in their order.

    Args:
        model: what the trials are compared with.
        logged: the trials as they are read.
        named: the same, with what is known of repeats.
        stated: what the lab states of its sensors, by signal.
    """
    assumed = sensors.noise_levels(model)
    return [
        _floor(signal, channel, assumed[channel], logged, named, (stated or {}).get(signal.name))
        for channel, signal in enumerate(model.rig.signals)
    ]


def _floor(
    signal: Signal,
    channel: int,
    assumed: float,
    logged: Sequence[Logged],
    named: Sequence[NamedTrial],
    stated: LabSensor | None,
) -> Level:
    parts = [_readings(each, channel) for each in logged if each.measures[channel]]
    step = step_between(logged, channel)
    expected = _expected_step(signal, parts, stated)
    rounding = (step or expected) / np.sqrt(12.0)
    sources = _sources(parts, assumed, rounding, stated)
    rest = level_at_rest(rest_readings(logged, channel))
    if rest is not None:
        sources[REST] = rest
    repeats = _between_repeats(logged, named, channel)
    if repeats is not None:
        sources["repeats"] = repeats
    source = next(name for name in (STATED, REST, MODEL, NEIGHBOURS) if name in sources)
    if rest is None and sparse(parts) and sources.get("repeats", 0.0) > sources[source]:
        source = "repeats"
    distinct = distinct_readings(logged, channel)
    finest = FINEST * float(np.ptp(distinct)) if distinct.size else 0.0
    level = max(sources[source], float(rounding), finest)
    shown = max(level_of_neighbours(parts), float(rounding)) if source == MODEL else level
    count = len(distinct)
    return Level(signal, level, source, sources, step, expected, count, min(level, shown))


def _expected_step(signal: Signal, parts: Sequence[Array], stated: LabSensor | None) -> float:
    """The step that a sensor should have (SI); 0 where nobody knows."""
    if stated is not None and stated.resolution is not None:
        return stated.resolution
    by_daq = all(read_by_daq(signal, part) for part in parts)
    return signal.resolution if by_daq else 0.0


def _sources(
    parts: Sequence[Array], assumed: float, rounding: float, stated: LabSensor | None
) -> dict[str, float]:
    """Levels (SI) that are known without rest or repeats, by where they come from."""
    sources = {}
    if stated is not None and stated.noise is not None:
        sources[STATED] = stated.noise
    neighbours = 0.0 if sparse(parts) or assumed > 0.0 else level_of_neighbours(parts)
    if neighbours:
        sources[NEIGHBOURS] = neighbours
    else:
        # 1 of a sensor of which nothing at all is known, as in any fit.
        sources[MODEL] = float(np.hypot(assumed, rounding)) or 1.0
    return sources


def _readings(logged: Logged, channel: int) -> Array:
    """A signal of a trial (SI), NaN where it was not read."""
    values = logged.measured[channel].copy()
    values[logged.missing[channel]] = np.nan
    return values


def _between_repeats(
    logged: Sequence[Logged], named: Sequence[NamedTrial], channel: int
) -> float | None:
    """Scatter between a trial and its repeats (SI); None without any, or of too few readings.

    Rms of their differences over root 2, their means taken out; of a signal that is read seldom
    and has no free zero, a mean over one or two readings is noise too, and stays.
    """
    groups: dict[str, list[int]] = {}
    for i, each in enumerate(named):
        groups.setdefault(each.repeat_of or each.name, []).append(i)
    few = sparse([_readings(each, channel) for each in logged if each.measures[channel]])
    centred = not few or logged[0].signals[channel].has_free_zero
    squares, count = 0.0, 0
    for group in groups.values():
        for i, j in zip(group, group[1:], strict=False):
            apart = difference(logged[i], logged[j], channel)
            if apart.size > centred:
                squares += float(np.sum((apart - centred * apart.mean()) ** 2)) / 2.0
                count += apart.size - centred
    return float(np.sqrt(squares / count)) if count else None
