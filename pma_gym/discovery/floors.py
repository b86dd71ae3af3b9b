"""Noise floors as a diagnosis knows them before it has fitted anything."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.dataset import NamedTrial
from pma_gym.discovery.noise import at_rest, distinct_readings, level_at_rest, step_between
from pma_gym.plant import sensors
from pma_gym.plant.logged import Logged
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

    level: float
    source: str
    by_source: dict[str, float]
    step: float
    expected_step: float
    distinct: int


def initial_floors(
    model: Model, logged: Sequence[Logged], named: Sequence[NamedTrial]
) -> list[Level]:
    """Levels of the four outputs."""
    assumed, found = sensors.noise_levels(model), []
    for channel, (_, line) in enumerate(sensors.SENSORS.values()):
        step = step_between(logged, channel)
        rounding = (step or line.resolution) / np.sqrt(12.0)
        sources = {"the model's sensor": float(np.hypot(assumed[channel], rounding))}
        rest = level_at_rest(at_rest(logged, channel))
        if rest is not None:
            sources["rest segments"] = rest
        repeats = _between_repeats(logged, named, channel)
        if repeats is not None:
            sources["repeats"] = repeats
        source = next(name for name in ("rest segments", "the model's sensor") if name in sources)
        level = max(sources[source], float(rounding))
        distinct = len(distinct_readings(logged, channel))
        found.append(Level(level, source, sources, step, line.resolution, distinct))
    return found


def _between_repeats(
    logged: Sequence[Logged], named: Sequence[NamedTrial], channel: int
) -> float | None:
    """Rms of the difference of repeats over root 2, their means taken out; None without any."""
    places = {each.name: i for i, each in enumerate(named)}
    squares, count = 0.0, 0
    for i, each in enumerate(named):
        first = places.get(each.repeat_of or "")
        if first is None or not logged[i].measures[channel] or not logged[first].measures[channel]:
            continue
        shared = min(len(logged[i].time), len(logged[first].time))
        if not np.array_equal(logged[i].time[:shared], logged[first].time[:shared]):
            continue
        both = logged[i].measured[channel, :shared] - logged[first].measured[channel, :shared]
        missing = np.union1d(logged[i].missing[channel], logged[first].missing[channel])
        both = np.delete(both, missing[missing < shared])
        if len(both) > 1:
            squares += float(np.sum((both - both.mean()) ** 2)) / 2.0
            count += len(both) - 1
    return float(np.sqrt(squares / count)) if count else None
