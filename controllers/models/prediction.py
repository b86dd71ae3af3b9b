"""Predict a plant under several voltage sequences at once, from its present state."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.integrator.trial_kernel import JOB
from pma_gym.plant.condition import Condition
from pma_gym.plant.plant import Plant

PLANS = 16
"""How many plans are tried at once: a whole number of registers of any processor."""


class Commands(NamedTuple):
    """Voltages (V) of both actuators: a number each, or an array of shape (plans, rows)."""

    motor: float | NDArray[np.float64]
    regulator: float | NDArray[np.float64]


class Prediction:
    """Simulates up to 16 voltage sequences from one state, and reuses the memory of earlier ones.

    The same compiled plant as `Plant.step`, with its arrays made once: of a prediction's 30 us,
    making them anew would be 200.

    Args:
        plant: the plant.
        times: when rows begin, from now, and the last one's end (s), shape (rows + 1,).
    """

    def __init__(self, plant: Plant, times: NDArray[np.float64]) -> None:
        self.plant, self.rows = plant, len(times) - 1
        rows, count = self.rows, len(plant.states)
        self._time = np.ascontiguousarray(times, float)
        self._motor, self._regulator = np.zeros((2, PLANS, rows + 1))
        self._start = np.zeros((PLANS, count + 2))
        self._states = np.zeros((PLANS, rows + 1, count))
        self._outputs = np.zeros((PLANS, rows + 1, len(plant.outputs)))
        self._taken, self._attempts = np.zeros(8, np.int64), np.zeros(8, np.int64)
        self._jobs = np.zeros((PLANS, len(JOB)), np.int64)
        for plan in range(PLANS):
            arrays = (self._motor, self._regulator, self._start, self._states)
            motor, regulator, start, states = (array[plan].ctypes.data for array in arrays)
            self._jobs[plan] = (
                *(rows + 1, 0, self._time.ctypes.data, motor, regulator),
                *(plant.table.ctypes.data, start, states),
            )
        shared = self._jobs, self._taken, self._attempts
        self._addresses = [array.ctypes.data for array in shared]

    def __deepcopy__(self, memo: dict[int, object]) -> "Prediction":
        """One with arrays of its own; the compiled plant never changes and is shared."""
        return Prediction(self.plant, self._time)

    def __call__(
        self, condition: Condition, commands: Commands, plans: int
    ) -> dict[str, NDArray[np.float64]]:
        """True outputs at the end of every row.

        Args:
            condition: where the plant stands; stays as it is.
            commands: in force in every row (V), for as many plans.
            plans: how many, 16 at most.
        Returns:
            contraction (m), rotation (rad), load (N), pressure (Pa) and extension (m), of shape
            (plans, rows) each, until the next call.
        """
        zero, count = condition.zero_contraction, len(self.plant.states)
        self._motor[:plans, :-1], self._regulator[:plans, :-1] = commands
        self._start[:plans, :count] = condition.state
        self._start[:plans, count:] = condition.size, zero
        program = self.plant.program
        self._taken[0] = 0
        program.simulate_many(plans, *self._addresses)
        program.observe(
            plans * (self.rows + 1),
            self._states.ctypes.data,
            zero,
            self.plant.vector.ctypes.data,
            self._outputs.ctypes.data,
        )
        seen = {name: self._outputs[:plans, 1:, i] for i, name in enumerate(self.plant.outputs)}
        seen["extension"] = zero - seen["contraction"]
        return seen
