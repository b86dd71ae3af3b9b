"""The dissertation's feed-forward, computed for any pressure and reference.

Voltages between samples 0.2 s apart, as the dissertation's station was driven.

The voltages that the dissertation printed.

Open loop: the voltage that the inverse of the nominal model gives for the reference.
"""

import math

import numpy as np

from controllers.design.designs import must_give_a_position
from controllers.models.nominal_motion import NominalMotion, nominal_motion
from controllers.models.voltage import VOLTAGE_LIMIT
from controllers.registry import Reference
from pma_gym.data.serres2008 import load_table, pressures
from pma_gym.envs import Measurement, StationInfo
from pma_gym.integrator.equations import Interpolation, check_interpolation
from pma_gym.studies.voltage_profile import SAMPLE_TIME, feedforward, reachable_mm
from pma_gym.tasks import TASKS


class VoltageTable:
    """Motor voltage by time, between samples 0.2 s apart; what both controllers here replay.

    Args:
        interpolation: `foh` joins the samples by lines; `zoh` holds each until the next. The
            dissertation does not say which its station did.

    Attributes:
        times: times of the samples (s).
        volts: motor voltages there (V).
    """

    name = "voltage_table"

    def __init__(self, interpolation: Interpolation = "foh") -> None:
        check_interpolation(interpolation)
        self.interpolation = interpolation
        self.times = np.zeros(1)
        self.volts = np.zeros(1)
        self._period = 0.0

    def voltage(self, time: float) -> float:
        """Motor voltage (V) at a time (s); the last sample's from there on."""
        if self.interpolation == "foh":
            return float(np.interp(time, self.times, self.volts))
        # A sample begins at its time, also when that time went through a division.
        at = int(np.searchsorted(self.times, time + 1e-9, side="right")) - 1
        return float(self.volts[max(at, 0)])

    def act(self, measurement: Measurement, time: float) -> float:
        """Motor voltage (V) in the middle of the period for which it is held.

        The mean of a line over a period is its value in the middle, so the replay does not lag
        behind the printed one by half a period, whatever the control rate.
        """
        return self.voltage(time + 0.5 * self._period)


PROFILE_RADIUS = 45e-3 / (math.pi / 2.0)
"""Radius of the pulley that the rotation profiles assume: 45 mm for 90 deg, 28.65 mm (m).

Serres 2008, tables I13-I20. Table I3 gives 25.4 mm; see the documentation of the physics.
"""


class SerresFeedforward(VoltageTable):
    """The dissertation's feed-forward, computed for any pressure in 150-575 kPa and reference.

    Every 0.2 s: the input that the cascade of motor and muscle needs for the reference (Tustin's
    recursion, inverted), then the lower root of the map from voltage to displacement, both linear
    in pressure between the dissertation's. In rotation it aims at the angle with its own pulley,
    45 mm for 90 deg. At a printed pressure it gives the printed voltages.

    Source:
        Serres 2008, sections 4.2 and 5.2.1.
    """

    name = "serres_feedforward"

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Compute the profile.

        Raises:
            ValueError: a pressure outside 150-575 kPa, or a reference beyond what the map reaches
                there, names the reachable range; or a task that the motor does not move.
        """
        must_give_a_position(station)
        if station.task.actuator != "motor":
            raise ValueError(
                f"{self.name} gives voltages of the motor: the task must be one of extension or "
                f"rotation, got {station.task.name}, in which the {station.task.actuator} moves; "
                "take improved_feedforward"
            )
        rotation = station.task.schedule.followed.is_angle
        radius = PROFILE_RADIUS if rotation else 1.0
        pressure_kpa = station.pressure / 1e3
        samples = math.ceil(station.task.schedule.duration / SAMPLE_TIME - 1e-9) + 1
        times = SAMPLE_TIME * np.arange(samples)
        target = radius * np.array([reference(float(time)) for time in times])
        try:
            profile = feedforward(target, pressure_kpa)
        except ValueError as error:
            raise ValueError(self._explained(error, pressure_kpa, rotation)) from error
        self._period = station.period
        self.times, self.volts = profile.time, profile.voltage

    def _explained(self, error: ValueError, pressure_kpa: float, rotation: bool) -> str:
        """The error, with the reach as an angle where the task is one."""
        if not rotation or not 150.0 <= pressure_kpa <= 575.0:
            return str(error)
        degrees = math.degrees(1e-3 * reachable_mm(pressure_kpa) / PROFILE_RADIUS)
        return f"{error} (rotation must lie in 0-{degrees:.4g} deg: 45 mm are 90 deg here)"


class SerresReplay(VoltageTable):
    """The voltages that the dissertation printed, unchanged.

    They follow the task's own reference, whatever reference is given, and exist at the pressures
    of the dissertation's trials alone. Those of rotation were computed for 45 mm at 90 deg.

    Source:
        Serres 2008, tables I4-I20.
    """

    name = "serres_replay"

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Look up the profile of the trial.

        Raises:
            ValueError: no profile was printed for this task or pressure; says for which one was.
        """
        if station.task.name not in TASKS:
            raise ValueError(
                f"the dissertation printed voltages of the tasks {' and '.join(TASKS)}, not of "
                f"{station.task.name}; take serres_feedforward for another extension or rotation, "
                "or another controller"
            )
        task, pressure_kpa = station.task.name, station.pressure / 1e3
        known = pressures(task)
        if not any(math.isclose(pressure_kpa, one) for one in known):
            raise ValueError(
                f"the dissertation printed voltages of the {task} task for "
                f"{', '.join(map(str, known))} kPa, not for {pressure_kpa:g} kPa; "
                "use serres_feedforward, which computes them for any pressure in 150-575 kPa"
            )
        self._period = station.period
        self.times, self.volts = printed_voltages(task, round(pressure_kpa))


def printed_voltages(task: str, pressure_kpa: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and motor voltages (V) of a printed profile.

    Args:
        task: `displacement` or `rotation`.
        pressure_kpa: one of `pressures(task)`.

    >>> times, volts = printed_voltages("displacement", 150)
    >>> float(times[1]), float(volts[1])
    (0.2, 0.122178)
    """
    first = 4 if task == "displacement" else 13
    table = load_table(f"I{first + pressures(task).index(pressure_kpa)}")
    return table["time_s"], table["motor_voltage_v"]


class ImprovedFeedforward:
    """The voltage that the nominal model needs for the reference, one value a control period.

        V = map^-1(y_ref) + lag compensation

    What it mends of the dissertation's feed-forward: the lag is inverted in continuous time, so
    there is no root at z = -1 and the voltage does not alternate; the map is the model's own
    balance of forces, neither a quadratic nor rounded; the drive's dead zone and the cable's
    slack are passed at once; voltages belong to control periods, not to 0.2 s. See
    `controllers.models.inverse` for the derivation. Where the model needs less than 0 or more than
    10 V it asks for the limit.

    It sees no sensor: what the model does not know stays as error.
    """

    name = "improved_feedforward"

    def __init__(self) -> None:
        self._motion: NominalMotion | None = None

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Compute the voltages of the whole trial, or take them as computed before."""
        self._motion = nominal_motion(reference, station)

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V) to send now, for it is in force the action delay later."""
        assert self._motion is not None, "reset comes first"
        return min(max(self._motion.command(time), 0.0), VOLTAGE_LIMIT)

    def voltage(self, time: float) -> float:
        """Voltage (V) that the motion needs in force at a time (s), also beyond the limits.

        After the trial's end that of the last period.
        """
        assert self._motion is not None, "reset comes first"
        return self._motion.voltage(time)
