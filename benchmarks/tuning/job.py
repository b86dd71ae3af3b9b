"""Rows of the table of gains."""

from dataclasses import dataclass

from controllers.design.designs import loop_name, task_kind
from controllers.pid import PID
from pma_gym.data.trial_schedule import TrialSchedule
from pma_gym.envs import StationInfo
from pma_gym.plant.model import Model
from pma_gym.tasks import EVERY_TASK

START_FACTOR = 0.3
"""Factor on the gains of the PID where the cable may go slack; see `Gains.scaled`. Set by hand: of
16 trials of phase III at each of 275, 500 and 575 kPa the worst fell from 0.41 to 0.29 deg."""


@dataclass(frozen=True)
class Job:
    """One row of the table of gains.

    Attributes:
        model: model to tune on.
        task: name of the task that is tried.
        controller: one of `CONTROLLERS`.
        pressure_kpa: gauge pressure that trials begin at (kPa).
        seed: seed of the sensors' noise on the nominal station; the others get the next ones.
        rate_hz: control rate (Hz).
        delay_s: how late a command reaches the station (s), whole periods.
    """

    model: Model
    task: str
    controller: str
    pressure_kpa: float
    seed: int
    rate_hz: float = 100.0
    delay_s: float = 0.0

    @property
    def station(self) -> StationInfo:
        """The station info that a controller of the row receives."""
        task, pressure = EVERY_TASK[self.task], self.pressure_kpa * 1e3
        return StationInfo(self.model, task, pressure, 1.0 / self.rate_hz, self.delay_s)

    @property
    def loop(self) -> str:
        """Name of its loop, such as `50hz_delay20ms`."""
        return loop_name(self.station)

    @property
    def kind(self) -> str:
        """Kind of its task: the tables are of one kind each."""
        return task_kind(self.station)

    @property
    def schedule(self) -> TrialSchedule:
        """The task's schedule."""
        return EVERY_TASK[self.task].schedule

    @property
    def start_factor(self) -> float:
        """`START_FACTOR` for a PID that brings the cable back to slack, else 1."""
        slack = "cable" in self.model.parameters and self.schedule.followed.is_angle
        return START_FACTOR if slack and self.controller == PID.name else 1.0
