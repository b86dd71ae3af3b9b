"""Open loop: one pressure for the whole exercise."""

from typing import TYPE_CHECKING

import numpy as np

from controllers.exercise.resistance import ANGLES, PRESSURES, Resistance, exercise_of, volts_of
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo

if TYPE_CHECKING:
    from pma_gym.tasks import Exercise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pma_gym.tasks import Exercise

CHANGE_S = 1.0
"""Time in which the one pressure is changed to from the trial's first (s), while the joint has
turned by no more than 18 deg."""


class ConstantPressure:
    """One pressure throughout, as the dissertation's trials had.

    Where the speed is prescribed it is the trial's first. Where a moment is, no pressure gives it
    at every angle: it is the one whose moments, of the nominal device at rest, lie nearest to the
    prescribed ones over 0-90 deg in the mean square; the pressure is changed to it in the first
    second, evenly.

    Attributes:
        pressure: the one that is held (Pa).

    Source:
        Serres 2008, section 6.3, as `pma_gym.plant.exercise_device.device` has it; the nearest
        one is our own.
    """

    name = "constant_pressure"
    kinds = ("isokinetic", "moment")

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Find the pressure.

        Raises:
            ValueError: the task is no exercise.
        """
        exercise = exercise_of(self.name, station)
        self._volts, self._first = volts_of(station), station.pressure
        prescribed = exercise.prescription is not None
        self.pressure = nearest_pressure(station, exercise) if prescribed else station.pressure

    def act(self, measurement: Measurement, time: float) -> float:
        """Regulator voltage (V)."""
        return self._volts(self._first + min(time / CHANGE_S, 1.0) * (self.pressure - self._first))


def nearest_pressure(station: StationInfo, exercise: "Exercise") -> float:
    """Pressure (Pa) whose moments miss a prescription least over 0-90 deg, in the mean square."""
    assert exercise.prescription is not None
    prescribed = np.array([exercise.prescription.at(angle) for angle in ANGLES.tolist()])
    moments = Resistance(station).moments
    fine = np.arange(PRESSURES[0], PRESSURES[-1], 1e3)
    available = np.array([np.interp(fine, PRESSURES, column) for column in moments.T])
    return float(fine[np.argmin(np.mean((available - prescribed[:, None]) ** 2, axis=0))])
