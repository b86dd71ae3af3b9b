"""Noise floors as a diagnosis knows them before it has fitted anything."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.signals import Signal
from pma_gym.discovery.preparation.acceptance_floors import difference
from pma_gym.discovery.preparation.noise import (
    at_rest,
    distinct_readings,
    level_at_rest,
    sparse,
    step_between,
)
from pma_gym.estimation.logged import Logged
from pma_gym.plant import sensors
from pma_gym.plant.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Level:
    """The noise of one signal (SI).

    Attributes:
        level: standard deviation.
        source: where it is known from.
        by_source: what each source says.
        step: smallest step between readings; 0 if none shows.
        expected_step: the step that the DAQ should have.
        distinct: how many readings differ from each other.
    """

    signal: Signal
    level: float
    source: str
    by_source: dict[str, float]
    step: float
    expected_step: float
    distinct: int


def initial_floors(
    model: Model, logged: Sequence[Logged], named: Sequence[NamedTrial]
) -> list[Level]:
    """Levels of the rig's signals, in their order."""
    assumed, steps, floors = sensors.noise_levels(model), sensors.resolutions(model), []
    channels = zip(model.rig.signals, sensors.deviations(model).tolist(), strict=True)
    for channel, (signal, unknown) in enumerate(channels):
        resolution = float(steps[channel])
        step = step_between(logged, channel)
        rounding = (step or resolution) / np.sqrt(12.0)
        sources = {"the model's sensor": float(np.hypot(assumed[channel], rounding))}
        rest = level_at_rest(at_rest(logged, channel))
        if rest is not None:
            sources["rest segments"] = rest
        repeats = _between_repeats(logged, named, channel)
        if repeats is not None:
            sources["repeats"] = repeats
        source = next(name for name in ("rest segments", "the model's sensor") if name in sources)
        parts = [_readings(each, channel) for each in logged if each.measures[channel]]
        if rest is None and sparse(parts) and sources.get("repeats", 0.0) > sources[source]:
            source = "repeats"
        # Of what no trial measures and the model has no sensor for, nothing is known.
        level = max(sources[source], float(rounding)) or unknown
        distinct = len(distinct_readings(logged, channel))
        floors.append(Level(signal, level, source, sources, step, resolution, distinct))
    return floors


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
