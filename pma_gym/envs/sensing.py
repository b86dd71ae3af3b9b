"""From the station to the agent: what its sensors say, and how late they are heard."""

from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pma_gym.envs.knowledge import Reading
from pma_gym.envs.options import Options
from pma_gym.plant import sensors
from pma_gym.plant.plant import OUTPUTS, Condition, Plant

TARE_READINGS = 192
"""Readings at rest whose mean is the sensors' zero: half a second at 384 Hz, as one would do."""


class SensorLine:
    """The sensors, and the wire from them to the agent, `observation_delay_s` long.

    Before the trial the station stood still: until a reading has come through, the one at the
    trial's start stands in for it.

    Args:
        options: the environment's options.

    Attributes:
        truth: true outputs (SI) at the last reading: contraction, rotation, load, pressure,
            extension.
    """

    def __init__(self, options: Options) -> None:
        """Keep what readings need."""
        self._noise = options.noise
        self._delay = options.observation_delay
        self._kept = self._delay + options.history + 1

    def begin(self, plant: Plant, condition: Condition, generator: np.random.Generator) -> None:
        """Zero the sensors at a settled station and take the first reading."""
        self._plant, self._generator = plant, generator
        self._levels = sensors.noise_levels(plant.model)
        held = self._look(condition)
        self._zero_contraction, self._zero_rotation = self._tare(held)
        self._readings = deque([self._reading(held, 0.0)] * self._kept, maxlen=self._kept)

    def take(self, condition: Condition, time: float) -> None:
        """Read every sensor at a time (s)."""
        self._readings.append(self._reading(self._look(condition), time))

    @property
    def reading(self) -> Reading:
        """The reading heard now."""
        return self._readings[-1 - self._delay]

    @property
    def earlier(self) -> list[Reading]:
        """Readings heard before, `history` of them, latest first."""
        return [self._readings[i] for i in range(self._kept - self._delay - 2, -1, -1)]

    def _look(self, condition: Condition) -> NDArray[np.float64]:
        """Note the truth; return what the sensors hold, lagged but without noise, shape (4,)."""
        states = condition.state[None, :]
        truth: Mapping[str, NDArray] = self._plant.observe(states, condition.zero_contraction)
        self.truth = {name: value.item() for name, value in truth.items()}
        return self._plant.lagged(states, truth)[0]

    def _tare(self, held: NDArray[np.float64]) -> tuple[float, float]:
        """Readings of contraction and rotation at rest; load and pressure keep their zeros."""
        if self._noise:
            normals = self._generator.standard_normal((TARE_READINGS, len(OUTPUTS)))
            held = sensors.read(held, self._levels, normals).mean(axis=0)
        return float(held[0]), float(held[1])

    def _reading(self, held: NDArray[np.float64], time: float) -> Reading:
        if self._noise:
            normals = self._generator.standard_normal(len(OUTPUTS))
            held = sensors.read(held, self._levels, normals)
        contraction, rotation, load, pressure = held.tolist()
        return Reading(
            time,
            self._zero_contraction - contraction,
            rotation - self._zero_rotation,
            load,
            pressure,
        )
