"""Rows of the table of gains."""

from dataclasses import dataclass

from controllers.pid import PID
from pma_gym.data.protocol import Protocol
from pma_gym.plant.model import Model
from pma_gym.tasks import TASKS

CONTROL_RATE_HZ = 100.0

START_FACTOR = 0.3
"""Factor on the gains of the PID where the cable may go slack; see `Gains.scaled`. Set by hand: of
16 trials of phase III at each of 275, 500 and 575 kPa the worst fell from 0.41 to 0.29 deg."""


@dataclass(frozen=True)
class Job:
    """One row of the table of gains.

    Attributes:
        model: model to tune on.
        task: `displacement` or `rotation`.
        controller: one of `CONTROLLERS`.
        pressure_kpa: gauge pressure (kPa).
        seed: seed of the sensors' noise on the nominal station; the others get the next ones.
    """

    model: Model
    task: str
    controller: str
    pressure_kpa: float
    seed: int

    @property
    def protocol(self) -> Protocol:
        """The task's protocol."""
        return TASKS[self.task].protocol

    @property
    def start_factor(self) -> float:
        """`START_FACTOR` for a PID that brings the cable back to slack, else 1."""
        slack = "cable" in self.model.parameters and self.protocol.quantity == "rotation"
        return START_FACTOR if slack and self.controller == PID.name else 1.0
