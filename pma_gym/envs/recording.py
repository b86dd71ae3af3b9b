"""What is kept of an episode: its states at 384 Hz, on which it is scored, and its voltages."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.envs.command import Volts
from pma_gym.metrics import SAMPLE_RATE_HZ, percent_of_range
from pma_gym.plant.plant import Condition, Plant
from pma_gym.tasks import Task, phase_rmse
from pma_gym.units import SI_FACTORS

SAMPLE_PERIOD = 1.0 / SAMPLE_RATE_HZ
"""Time between two samples (s), whatever the control rate."""


class Recording:
    """An episode as it runs.

    Args:
        plant: the plant.
        condition: where it begins; `record` moves it on.
        steps: control steps of a whole episode.
        period: time of a control step (s).

    Attributes:
        count: control steps so far.
    """

    def __init__(self, plant: Plant, condition: Condition, steps: int, period: float) -> None:
        """Make room for a whole episode, and take the first sample."""
        self._plant, self._condition, self._period = plant, condition, period
        self.count = 0
        self._voltages = np.empty(steps)
        last = math.floor(steps * period * SAMPLE_RATE_HZ + 1e-6)
        self._samples = np.full((last + 1, len(plant.states)), np.nan)
        self._samples[0] = condition.state

    @property
    def time(self) -> float:
        """Time since the trial began (s)."""
        return self.count * self._period

    @property
    def motor_voltages(self) -> NDArray[np.float64]:
        """Motor voltage of every step so far (V), shape (steps,)."""
        return self._voltages[: self.count].copy()

    def record(self, volts: Volts) -> None:
        """Let one control step pass at constant voltages."""
        self._plant.step(
            self._condition,
            volts.motor,
            volts.regulator,
            self._period,
            SAMPLE_PERIOD,
            self._samples,
        )
        self._voltages[self.count] = volts.motor
        self.count += 1
        # A sum of periods would drift away from the grid of samples.
        self._condition.time = self.time

    def trajectory(self, quantity: str) -> NDArray[np.float64]:
        """A true output (SI) at k / 384 s as far as the episode has come, shape (samples,)."""
        reached = np.count_nonzero(~np.isnan(self._samples[:, 0]))
        truth = self._plant.observe(self._samples[:reached], self._condition.zero_contraction)
        return truth[quantity]

    def score(self, task: Task) -> dict[str, Any]:
        """RMSE so far at the door: the figures of `PMAEnv.episode_summary`."""
        protocol = task.protocol
        unit, factor = protocol.unit, SI_FACTORS[protocol.unit]
        errors = phase_rmse(protocol, self.trajectory(protocol.quantity))
        total = errors.pop("all")
        return {
            f"rmse_{unit}": total / factor,
            f"rmse_by_phase_{unit}": {name: error / factor for name, error in errors.items()},
            "percent_of_range": percent_of_range(total, protocol.span),
        }
