"""Open loop in the moment: one pressure, or the pressure that a prescription needs at an angle."""

from typing import TYPE_CHECKING

import numpy as np

from controllers.controller import Reference
from controllers.exercise.resistance import ANGLES, PRESSURES, Resistance, exercise_of, volts_of
from pma_gym.envs import Reading, Station
from pma_gym.plant.exercise import own_device
from pma_gym.plant.prescription import follow_from

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
        Serres 2008, section 6.3, as `pma_gym.plant.exercise` has it; the nearest one is our own.
    """

    name = "constant_pressure"
    kinds = ("isokinetic", "moment")

    def reset(self, reference: Reference, station: Station) -> None:
        """Find the pressure.

        Raises:
            ValueError: the task is no exercise.
        """
        exercise = exercise_of(self.name, station)
        self._volts, self._first = volts_of(station), station.pressure
        prescribed = exercise.prescription is not None
        self.pressure = nearest_pressure(station, exercise) if prescribed else station.pressure

    def act(self, observation: Reading, time: float) -> float:
        """Regulator voltage (V)."""
        share = min(time / CHANGE_S, 1.0)
        return self._volts(self._first + share * (self.pressure - self._first))


class ScheduledPressure:
    """The pressure at which the nominal device gives the prescribed moment at the measured angle.

    Found before the trial every 5 deg (`pma_gym.plant.prescription.follow_from`) and linear in
    between. Damping, hysteresis and whatever the station differs in are left to themselves, and so
    is an exercise of one speed: there the operator expects what the device gives at the trial's
    first pressure, which is all that a schedule over the angle could give him.
    """

    name = "scheduled_pressure"
    kinds = ("moment",)

    def reset(self, reference: Reference, station: Station) -> None:
        """Find the pressures.

        Raises:
            ValueError: the task prescribes no moment, or one that no pressure gives.
        """
        exercise_of(self.name, station, prescribed=True)
        self._volts, self._schedule = volts_of(station), schedule(station)

    def act(self, observation: Reading, time: float) -> float:
        """Regulator voltage (V)."""
        return self._volts(float(np.interp(observation.rotation, ANGLES, self._schedule)))


def nearest_pressure(station: Station, exercise: "Exercise") -> float:
    """Pressure (Pa) whose moments miss a prescription least over 0-90 deg, in the mean square."""
    assert exercise.prescription is not None
    wanted = np.array([exercise.prescription.at(angle) for angle in ANGLES.tolist()])
    moments = Resistance(station).moments
    fine = np.arange(PRESSURES[0], PRESSURES[-1], 1e3)
    given = np.array([np.interp(fine, PRESSURES, column) for column in moments.T])
    missed = np.mean((given - wanted[:, None]) ** 2, axis=0)
    return float(fine[np.argmin(missed)])


def schedule(station: Station) -> np.ndarray:
    """Pressures (Pa) over `ANGLES` that give the prescribed moments, shape (angles,).

    Raises:
        ValueError: no pressure gives one of them; says where, and what can be had there.
    """
    exercise, model = station.task.exercise, station.model
    assert exercise is not None and exercise.prescription is not None
    wanted = np.array([exercise.prescription.at(angle) for angle in ANGLES.tolist()])
    start = station.pressure, exercise.start_moment
    return follow_from(model, own_device(model), ANGLES, wanted, *start).pressure
