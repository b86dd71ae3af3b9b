"""Inputs of a controller: the station's data before a trial, a measurement in every control step.

They are detached copies without a reference to the environment. Through them a controller can
neither read the true state nor change the simulation.
"""

import copy
from dataclasses import dataclass
from typing import NamedTuple

from pma_gym.data.trial_schedule import TrialSchedule
from pma_gym.engine.nominal_rig import rest_load
from pma_gym.plant.model import Model
from pma_gym.tasks import Task


@dataclass(frozen=True, slots=True)
class Reference:
    """The reference of a trial as a function of the time (s) since its start.

    It returns extension or contraction (m) or rotation (rad), for past and future times. If an
    exercise prescribes a moment, the reference is that of the moment's excess (N m), which is 0.

    Attributes:
        schedule: a copy of the task's schedule.
    """

    schedule: TrialSchedule

    def __call__(self, time: float) -> float:
        """The reference at a time (s)."""
        return self.schedule.at(time)


def detached_task(task: Task) -> Task:
    """Copy a task without shared mutable data; a motion that cannot be copied stays shared."""
    return copy.deepcopy(task)


@dataclass(frozen=True)
class StationInfo:
    """Data of the station that a controller receives before a trial.

    Attributes:
        model: a copy of the nominal model, also if every reset draws another plant.
        task: the task, with its schedule; a copy.
        pressure: gauge pressure at the trial's start (Pa).
        period: duration of a control step (s).
        action_delay: delay of a command to the station (s), whole periods.
        observation_delay: age of a measurement when the controller receives it (s), whole periods.
    """

    model: Model
    task: Task
    pressure: float
    period: float
    action_delay: float = 0.0
    observation_delay: float = 0.0

    @property
    def load(self) -> float:
        """Constant load of the motor in a regulator's task (N); 0 in a motor's task.

        In an exercise, in which the motor simulates the operator, it is the initial load.
        """
        return rest_load(self.model, self.task)

    def moment(self, measurement: "Measurement") -> float:
        """Moment at an exercise's joint, from the load cell and the nominal pulley (N m)."""
        return self.model.parameters["rotor"].radius * measurement.load

    def position(self, measurement: "Measurement") -> float:
        """Measured position of the task's controlled quantity (m, rad or N m)."""
        followed = self.task.schedule.followed
        if followed.is_angle:
            return measurement.rotation
        if followed.is_force:
            assert self.task.exercise and self.task.exercise.prescription
            return self.moment(measurement) - self.task.exercise.prescription.at(
                measurement.rotation
            )
        return -measurement.extension if followed.shortens else measurement.extension


class Measurement(NamedTuple):
    """Measured values at one instant (SI); extension and rotation count from the trial's zeros.

    Attributes:
        time: time of the measurement since the trial's start (s).
        extension: extension of the muscle from its initial contraction (m), which is that without
            load, or under the load of a regulator's task; there it is negative while the muscle
            shortens.
        rotation: pulley angle (rad).
        load: cable tension (N).
        pressure: gauge pressure (Pa).
    """

    time: float
    extension: float
    rotation: float
    load: float
    pressure: float
