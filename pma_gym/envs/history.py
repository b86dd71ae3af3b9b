"""An engine that keeps what the pictures of a batch draw: positions and voltages by step."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.envs.engine import Engine
from pma_gym.envs.options import Pressure
from pma_gym.units import SI_FACTORS


class History(NamedTuple):
    """The course of an episode so far.

    Attributes:
        time: times of the positions since the trial began (s), shape (k,).
        position: true positions that the task asks for (m, rad or N m), shape (k,).
        voltages: voltage of the task's actuator in every control step (V), shape (steps,).
    """

    time: NDArray[np.float64]
    position: NDArray[np.float64]
    voltages: NDArray[np.float64]


class RecordingEngine(Engine):
    """An `Engine` that writes down position and voltage of every environment at every step.

    Only a batch that renders has one: the step of any other batch does nothing for it.

    Args:
        arguments: as `Engine`.
    """

    def __init__(self, *arguments: Any) -> None:
        """Compile, and make room for whole episodes."""
        super().__init__(*arguments)
        protocol = self.task.protocol
        self._shown = f"{protocol.quantity}_{protocol.suffix}", SI_FACTORS[protocol.unit]
        # A batch may step an episode that has ended once more.
        steps = self.task.steps(self.options.control_rate_hz) + 2
        self._positions = np.zeros((steps + 1, self.count))
        self._voltages = np.zeros((steps, self.count))

    def step(self) -> int:
        """Step, see `Engine`, and write down where each environment is."""
        ended = super().step()
        every = np.arange(self.count)
        counts = np.minimum(self.counts(), len(self._voltages))
        self._write(counts, every)
        self._voltages[np.maximum(counts - 1, 0), every] = self.numbers(
            f"{self.task.actuator}_voltage"
        )
        return ended

    def reset(self, indices: NDArray[np.int64], wanted: Sequence[Pressure] | None = None) -> None:
        """Begin an episode, see `Engine`, and write down where it begins."""
        super().reset(indices, wanted)
        self._write(np.zeros(len(indices), np.int64), indices)

    def _write(self, counts: NDArray[np.int64], indices: NDArray[np.int64]) -> None:
        name, factor = self._shown
        self._positions[counts, indices] = self.numbers(name)[indices] * factor

    def history(self, index: int) -> History:
        """The course of an environment's episode at its control steps."""
        count = min(self.steps(index), len(self._voltages))
        return History(
            np.arange(count + 1.0) * self.options.period,
            self._positions[: count + 1, index].copy(),
            self._voltages[:count, index].copy(),
        )
