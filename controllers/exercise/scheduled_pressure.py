"""Open loop in the moment: one pressure, or the pressure that a prescription needs at an angle."""

import numpy as np

from controllers.exercise.resistance import ANGLES, exercise_of, volts_of
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo
from pma_gym.plant.exercise_device.device import own_device
from pma_gym.plant.exercise_device.prescription import follow_from


class ScheduledPressure:
    """The pressure at which the nominal device gives the prescribed moment at the measured angle.

    Found before the trial every 5 deg
    (`pma_gym.plant.exercise_device.prescription.follow_from`) and linear in between. Damping,
    hysteresis and whatever the station differs in are left to themselves, and so is an exercise of
    one speed: there the operator expects what the device gives at the trial's first pressure, which
    is all that a schedule over the angle could give him.
    """

    name = "scheduled_pressure"
    kinds = ("moment",)

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Find the pressures.

        Raises:
            ValueError: the task prescribes no moment, or one that no pressure gives.
        """
        exercise_of(self.name, station, prescribed=True)
        self._volts, self._schedule = volts_of(station), schedule(station)

    def act(self, measurement: Measurement, time: float) -> float:
        """Regulator voltage (V)."""
        return self._volts(float(np.interp(measurement.rotation, ANGLES, self._schedule)))


def schedule(station: StationInfo) -> np.ndarray:
    """Pressures (Pa) over `ANGLES` that give the prescribed moments, shape (angles,).

    Raises:
        ValueError: no pressure gives one of them; says where, and what can be had there.
    """
    exercise, model = station.task.exercise, station.model
    assert exercise is not None and exercise.prescription is not None
    prescribed = np.array([exercise.prescription.at(angle) for angle in ANGLES.tolist()])
    start = station.pressure, exercise.start_moment
    return follow_from(model, own_device(model), ANGLES, prescribed, *start).pressure
