"""PID on the moment at the joint, on top of the scheduled pressure.

Open loop in the moment: one pressure, or the pressure that a prescription needs at an angle.

Open loop: one pressure for the whole exercise.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from controllers.exercise.resistance import (
    ANGLES,
    PRESSURES,
    Arrival,
    JointSpeed,
    Resistance,
    exercise_of,
    volts_of,
)
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo
from pma_gym.plant.exercise_device.device import own_device
from pma_gym.plant.exercise_device.prescription import follow_from

if TYPE_CHECKING:
    from pma_gym.tasks import Exercise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pma_gym.tasks import Exercise


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


class MomentGains(NamedTuple):
    """Gains; tuned on operators of seeds from 1000000 on.

    Attributes:
        proportional: moment let go for each N m that it is too large, k_p.
        integral: its growth, k_i (1/s).
        derivative: k_d (s).
        filter: time constant of the derivative's filter, and of the speed's (s).
        schedule: share of the schedule: 1, or 0 for the trial's first pressure in its place.
        lead: how far ahead of its time the angle is taken for the schedule (s).
    """

    proportional: float = 2.0
    integral: float = 25.0
    derivative: float = 0.05
    filter: float = 0.02
    schedule: float = 1.0
    lead: float = 0.06


class MomentPID:
    """Lowers the pressure where the moment is too large, beside what `ScheduledPressure` gives.

        P = P_schedule(theta + lead w) - (k_p e + S + k_d e') / h,   S' = k_i e

    e is the measured moment less the prescribed one, h as in `SpeedPID`, whose rule for the sum's
    waiting holds too. Without the schedule (`schedule=0`) errors are
    larger, by phase 1.5, 2.0 and 1.6 times for 8 N m, 1.4, 1.2 and 1.1 times for the profile (48
    operators of seeds from 7000000 on, nominal station).

    Args:
        gains: its gains.
    """

    name = "moment_pid"
    kinds = ("moment",)

    def __init__(self, gains: MomentGains | None = None) -> None:
        self.gains = gains or MomentGains()

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Begin at the trial's first pressure and moment.

        Raises:
            ValueError: the task prescribes no moment, or one that no pressure gives.
        """
        exercise_of(self.name, station, prescribed=True)
        self._station, self._period, self._volts = station, station.period, volts_of(station)
        self._device, self._arrival = Resistance(station), Arrival(station)
        away = schedule(station) - station.pressure
        self._schedule = station.pressure + self.gains.schedule * away
        self._speed = JointSpeed(station, self.gains.filter)
        self._kept = math.exp(-station.period / self.gains.filter)
        self._sum = self._slope = 0.0
        self._over: float | None = None

    def act(self, measurement: Measurement, time: float) -> float:
        """Regulator voltage (V)."""
        gains, angle = self.gains, measurement.rotation
        over = self._station.position(measurement)
        slope = 0.0 if self._over is None else (over - self._over) / self._period
        self._slope, self._over = slope + self._kept * (self._slope - slope), over
        moment = gains.proportional * over + self._sum + gains.derivative * self._slope
        coming = angle + gains.lead * self._speed.update(measurement)
        pressure = float(np.interp(coming, ANGLES, self._schedule))
        pressure -= moment / self._device.at(measurement.pressure, angle).influence
        if not self._arrival.is_saturated(measurement.pressure, -over):
            self._sum += gains.integral * self._period * over
        self._arrival.command(pressure)
        return self._volts(pressure)


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
