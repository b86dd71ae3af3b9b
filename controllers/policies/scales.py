"""What entries of a policy's view are measured by: of small errors, and of an exercise."""

from typing import Any

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial_schedule import TrialSchedule
from pma_gym.engine.observation import ROTATION_SCALE, Prescribed
from pma_gym.envs import StationInfo
from pma_gym.tasks import Task
from pma_gym.units import SI_FACTORS

FINE_SHARE = 0.01
"""Share of the task's range that an error of 1.0 stands for: 0.25 mm, 0.9 deg.

The sensors' noise is a tenth of it, so that a network of ordinary weights hears it; what is worse
than five times as large is clipped.
"""

PRESSURE_CHANGE, LOAD_CHANGE = 20e3, 50.0
"""Change of the pressure (Pa), and of the load (N), that 1.0 stands for."""

COARSE_SHARE = 0.04
"""The same of an exercise, 3.6 deg: a joint that nobody has begun to turn yet is 5 deg late."""

EXERCISE_PRESSURE, EXERCISE_LOAD = 100e3, 200.0
"""What 1.0 stands for in an exercise: change of the pressure (Pa), and load (N)."""


class Scales:
    """What the entries of a trial are measured by.

    Args:
        station: as controllers know it; its model must be of a station.

    Attributes:
        fine: error that 1.0 stands for (m or rad).
        span: the task's range (m or rad).
        quantity: what the task asks for.
        radius: of the nominal pulley (m).
        delay: control steps after which a command is in force.
    """

    def __init__(self, station: StationInfo) -> None:
        parameters = station.model.parameters
        if "drive" not in parameters or "rotor" not in parameters:
            raise ValueError(
                f"a tracking view needs the model of a station, with its drive and pulley; got "
                f"{station.model.name}, a {station.model.plant}: take station or serres2008"
            )
        schedule = station.task.schedule
        self.span, self.fine = schedule.span, FINE_SHARE * schedule.span
        self.quantity = schedule.quantity
        self.radius = parameters["rotor"].radius
        self.delay = round((station.action_delay + station.observation_delay) / station.period)
        self._gain, self._offset = parameters["drive"].gain, parameters["drive"].offset
        self._held = station.load

    def entries(self, reading: Any, reference: Any, start: Any, volts: Any) -> tuple[Any, ...]:  # noqa: ANN401
        """The four entries of a reading, before they are clipped; of numbers or arrays.

        Args:
            reading: extension (m), rotation (rad), load (N), pressure (Pa).
            reference: when the reading was taken (m or rad).
            start: pressure that the trial began at (Pa).
            volts: motor voltage in force then (V), if the task is the motor's.
        """
        extension, rotation, load, pressure = reading
        if SIGNALS[self.quantity].is_angle:
            own, other = rotation, extension / self.radius
        elif SIGNALS[self.quantity].shortens:
            own, other = -extension, -self.radius * rotation
        else:
            own, other = extension, self.radius * rotation
        asked = self._held if self._held else self._gain * volts + self._offset
        # The drive cannot push; half the sum of a number and its size is its positive part.
        asked = 0.5 * (asked + abs(asked))
        return (
            (reference - own) / self.fine,
            (reference - other) / self.fine,
            (pressure - start) / PRESSURE_CHANGE,
            (load - asked) / LOAD_CHANGE,
        )


class ExerciseScales(Scales):
    """What the entries of an exercise are measured by: as `Scales`, of a regulator that resists."""

    def __init__(self, station: StationInfo) -> None:
        super().__init__(station)
        exercise = station.task.exercise
        assert exercise is not None
        self._plan = exercise.prescription
        self._coarse = COARSE_SHARE * self.span

    def entries(self, reading: Any, reference: Any, start: Any, volts: Any) -> tuple[Any, ...]:  # noqa: ANN401, ARG002
        """The four entries of a reading, before they are clipped; of numbers or arrays.

        Args:
            reading: extension (m), rotation (rad), load (N), pressure (Pa).
            reference: when the reading was taken (rad, or 0 N m).
            start: pressure that the trial began at (Pa).
            volts: of no use here: the motor is the operator's.
        """
        extension, rotation, load, pressure = reading
        if self._plan is None:
            first = (reference - rotation) / self._coarse
            second = (reference - extension / self.radius) / self.fine
        else:
            first = -Prescribed(self.radius, self._plan).excess(load, rotation) / self._coarse
            second = rotation / ROTATION_SCALE
        return first, second, (pressure - start) / EXERCISE_PRESSURE, load / EXERCISE_LOAD


def scales_of(station: StationInfo) -> Scales:
    """What a station's entries are measured by."""
    return ExerciseScales(station) if station.task.exercise else Scales(station)


def delayed_rows(task: Task) -> list[tuple[str, str]]:
    """Names of the four entries of a reading, and what 1.0 stands for, in order."""
    error, fine = "reference less measured position", share_of(task.schedule, FINE_SHARE)
    change, other = (
        "pressure less pressure at the trial's start",
        "reference less position by the other sensor",
    )
    if task.exercise is None:
        load = "load less what the nominal drive is asked for"
        return [(error, fine), (other, fine), (change, "20 kPa"), (load, "50 N")]
    coarse, rest = share_of(task.schedule, COARSE_SHARE), [(change, "100 kPa"), ("load", "200 N")]
    if task.exercise.prescription is None:
        return [(error, coarse), (other, fine), *rest]
    return [("prescribed less measured moment", coarse), ("measured rotation", "90 deg"), *rest]


def share_of(schedule: TrialSchedule, share: float) -> str:
    """A share of a task's range in words.

    >>> from pma_gym.tasks import TASKS
    >>> share_of(TASKS["rotation"].schedule, 0.01)
    '0.9 deg'
    """
    return f"{share * schedule.span / SI_FACTORS[schedule.unit]:g} {schedule.unit}"
