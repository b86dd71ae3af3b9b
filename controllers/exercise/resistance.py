"""Static moment of the nominal exercise device, its cable set as the trial began."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.envs import Measurement, StationInfo
from pma_gym.plant.exercise_device.device import FULL_ANGLE, own_device, resistive_moment
from pma_gym.tasks import Exercise


class JointSpeed:
    """The extension's change over the nominal pulley's radius, through a filter of the first order.

    The LVDT is finer than the potentiometer. What the cable stretches is taken for no motion.

    Args:
        station: the station as the controller knows it.
        time_constant: of the filter (s).

    Attributes:
        speed: of late (rad/s).
    """

    def __init__(self, station: StationInfo, time_constant: float) -> None:
        self._rate = 1.0 / (station.period * station.model.parameters["rotor"].radius)
        self._kept = math.exp(-station.period / time_constant)
        self.speed = self._extension = 0.0

    def update(self, reading: Measurement) -> float:
        """Take a reading; the speed (rad/s)."""
        rate = self._rate * (reading.extension - self._extension)
        self._extension = reading.extension
        self.speed = rate + self._kept * (self.speed - rate)
        return self.speed


PRESSURES = np.arange(0.0, 601e3, 25e3)
"""Pressures of the table (Pa): as far as the shipped models allow."""

ANGLES = np.linspace(0.0, FULL_ANGLE, 19)
"""Angles of the table (rad), every 5 deg."""

LEAST_INFLUENCE = 0.04e-3
"""Change of the moment by the pressure where no cable hangs slack, at least (N m/Pa). The nominal
device has 0.05 to 0.09; where its cable is slack the pressure changes nothing, and a gain over
nothing would have no end."""


AWAY_PA = 16e3
"""How far the pressure may be from where the nominal regulator would have it (Pa), beyond which it
is taken to be held; an assumption, found by random search with the gains of `SpeedPID`."""

RANGE_V = 10.0
"""Largest voltage of the regulator (V)."""


class Local(NamedTuple):
    """The device near an angle and a pressure.

    Attributes:
        moment: at rest (N m).
        influence: change of the moment by the pressure h, `LEAST_INFLUENCE` or more (N m/Pa).
        stiffness: change of the moment by the angle k (N m/rad).
    """

    moment: float
    influence: float
    stiffness: float


class Resistance:
    """Moment of the nominal device by pressure and angle, read off a table.

    Args:
        station: in an exercise; its pressure is the one that the cable was set at.

    Attributes:
        moments: table over `PRESSURES` and `ANGLES` (N m).
    """

    def __init__(self, station: StationInfo) -> None:
        exercise = station.task.exercise
        assert exercise is not None
        self.moments = _table(station, exercise.start_moment)
        self._rows: list[list[float]] = self.moments.tolist()
        self._pressure_step = float(PRESSURES[1])
        self._angle_step = float(ANGLES[1])

    def at(self, pressure: float, angle: float) -> Local:
        """Moment and slopes at a pressure (Pa) and an angle (rad), bilinear, held at the ends."""
        row, down = _place(pressure / self._pressure_step, len(self._rows))
        column, right = _place(angle / self._angle_step, len(self._rows[0]))
        low, high = self._rows[row], self._rows[row + 1]
        left = low[column] + right * (low[column + 1] - low[column])
        above = high[column] + right * (high[column + 1] - high[column])
        slope = (1.0 - down) * (low[column + 1] - low[column])
        slope += down * (high[column + 1] - high[column])
        return Local(
            left + down * (above - left),
            max((above - left) / self._pressure_step, LEAST_INFLUENCE),
            slope / self._angle_step,
        )


ABLE = {
    None: "exercises (isokinetic_exercise, isotonic_exercise, profile_exercise)",
    True: "exercises that prescribe a moment (isotonic_exercise, profile_exercise)",
    False: "the exercise that prescribes the speed (isokinetic_exercise)",
}
"""What a controller can do, in words, by whether it follows a moment; None: either."""


def exercise_of(name: str, station: StationInfo, prescribed: bool | None = None) -> Exercise:
    """The exercise of a station's task, if a controller can do it.

    Args:
        name: of the controller.
        station: the station as the controller knows it.
        prescribed: whether it follows a moment (True) or holds the speed (False); None: either.
    Raises:
        ValueError: it cannot; says which tasks it can do.
    """
    exercise = station.task.exercise
    if exercise is not None and prescribed in (None, exercise.prescription is not None):
        return exercise
    raise ValueError(
        f"controller {name}: the task must be one of {ABLE[prescribed]}, got {station.task.name}; "
        "take one of them, or another controller"
    )


class Arrival:
    """Whether the pressure reaches its command.

    The nominal regulator is a lag: believed' = (commanded - believed) / tau.

    Args:
        station: the station as the controller knows it.
    """

    def __init__(self, station: StationInfo) -> None:
        lag = station.model.parameters["regulator_lag"].time_constant
        self._kept = math.exp(-station.period / lag)
        self._lowest, self._highest = pressures_of(station)
        self._believed = self._commanded = station.pressure

    def command(self, pressure: float) -> None:
        """Let a period pass in which a pressure (Pa) was asked for, within 0-10 V or beyond."""
        self._commanded = pressure
        reached = min(max(pressure, self._lowest), self._highest)
        self._believed = reached + self._kept * (self._believed - reached)

    def is_saturated(self, pressure: float, rise: float) -> bool:
        """Whether a change of the command in this direction has no effect on the pressure.

        Args:
            pressure: as measured (Pa).
            rise: positive for a higher pressure, negative for a lower one.
        """
        if not self._lowest < self._commanded < self._highest:
            return (self._commanded >= self._highest) == (rise > 0.0)
        away = self._believed - pressure
        return abs(away) > AWAY_PA and (away > 0.0) == (rise > 0.0)


def pressures_of(station: StationInfo) -> tuple[float, float]:
    """Pressures (Pa) that the regulator gives at 0 V, or no pressure at all, and at 10 V."""
    line = station.model.parameters["regulator_line"]
    return max(line.offset, 0.0), line.gain * RANGE_V + line.offset


def volts_of(station: StationInfo) -> Callable[[float], float]:
    """What gives the regulator's volts, held to 0-10 V, of a pressure (Pa), by the nominal line."""
    line = station.model.parameters["regulator_line"]
    gain, offset = line.gain, line.offset
    return lambda pressure: min(max((pressure - offset) / gain, 0.0), RANGE_V)


def _place(at: float, count: int) -> tuple[int, float]:
    """Cell of a place on an even grid, and the share of the cell; held to the grid."""
    clipped = min(max(at, 0.0), count - 1.0)
    cell = min(int(clipped), count - 2)
    return cell, clipped - cell


def _table(station: StationInfo, start_moment: float) -> NDArray[np.float64]:
    """Moments (N m), shape (pressures, angles)."""
    model = station.model
    set_at = station.pressure, start_moment
    return resistive_moment(model, own_device(model), PRESSURES[:, None], ANGLES, *set_at).moment
