"""What a controller receives: the station before a trial, a measurement in every control step.

All of it is detached: copies that hold no environment, so that neither the true state nor anything
that the simulation reads can be reached or changed through them.
"""

import copy
from dataclasses import dataclass
from typing import NamedTuple

from pma_gym.data.trial_schedule import TrialSchedule
from pma_gym.engine.nominal_rig import rest_load
from pma_gym.plant.model import Model
from pma_gym.renamed_names import renamed_attribute, renamed_names
from pma_gym.tasks import Task


@dataclass(frozen=True, slots=True)
class Reference:
    """The reference of a trial, to be called with a time (s) since the trial began.

    It returns extension or contraction (m) or rotation (rad), past and future; where an exercise
    prescribes a moment, the moment's excess (N m), which is to be 0.

    Attributes:
        schedule: a copy of the task's schedule.
    """

    schedule: TrialSchedule
    protocol = renamed_attribute("protocol", "schedule")

    def __call__(self, time: float) -> float:
        """The reference at a time (s)."""
        return self.schedule.at(time)


def detached_task(task: Task) -> Task:
    """A copy of a task that shares nothing mutable with it, but a motion that cannot be copied."""
    return copy.deepcopy(task)


@dataclass(frozen=True)
class StationInfo:
    """What a controller may know of the station before a trial.

    Attributes:
        model: the nominal model, also where the plant's own is drawn anew at every reset; a copy.
        task: the task, with its schedule; a copy.
        pressure: gauge pressure that the trial begins at (Pa).
        period: time of a control step (s).
        action_delay: time from a command to the station (s), whole periods.
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
        """Load that the motor holds while the regulator moves (N); 0 where the motor moves.

        In an exercise the load that it begins with: the motor is the operator.
        """
        return rest_load(self.model, self.task)

    def moment(self, measurement: "Measurement") -> float:
        """Moment at an exercise's joint, as the load cell says it by the nominal pulley (N m)."""
        return self.model.parameters["rotor"].radius * measurement.load

    def position(self, measurement: "Measurement") -> float:
        """The position that the task asks for, as the sensors say it (m, rad or N m)."""
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
    """The sensors' readings at one instant, in SI; extension and rotation from their zeros.

    Attributes:
        time: when it was taken, since the trial began (s).
        extension: how far the muscle was pulled out of the contraction that the trial began at (m):
            that at no load, or under the load of a regulator's task, where it is negative while the
            muscle shortens.
        rotation: pulley angle (rad).
        load: cable tension (N).
        pressure: gauge pressure (Pa).
    """

    time: float
    extension: float
    rotation: float
    load: float
    pressure: float


__getattr__ = renamed_names(__name__, {"Station": StationInfo, "Reading": Measurement})
