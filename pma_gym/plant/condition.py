"""The condition of a running plant: its state, its time and its last commands."""

import math
from dataclasses import dataclass

import numpy as np

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.integrator.step_attempt import first_size
from pma_gym.plant.model import Model
from pma_gym.plant.program import FIRST_S
from pma_gym.plant.sensors import direct_command


@dataclass
class Condition:
    """State, time and last commands of a plant.

    Attributes:
        state: the state vector (SI), changed in place by `Plant.step`.
        zero_contraction: contraction x0 without load at the trial's start (m), the zero of
            extension.
        time: time since the trial began (s).
        size: proposed size of the next internal step (s).
        commands: last motor and regulator voltage (V), or None.
    """

    state: np.ndarray
    zero_contraction: float
    time: float = 0.0
    size: float = FIRST_S
    commands: tuple[float, float] | None = None

    def receive(self, motor_voltage: float, regulator_voltage: float) -> None:
        """Set the commands (V); after a jump the next internal step begins smaller."""
        commands = (motor_voltage, regulator_voltage)
        before = self.commands or commands
        jump = max(abs(new - old) for new, old in zip(commands, before, strict=True))
        self.size, self.commands = first_size(self.size, jump), commands


def check_commands(model: Model, motor: float, regulator: float) -> None:
    """Reject commands outside the range of drive or regulator.

    Args:
        model: defines whether the drive takes a voltage of 0-10 V or a command in SI.
        motor: the motor's command (V, or the SI unit of the drive's command).
        regulator: the regulator's (V).
    Raises:
        ValueError: with the command, its value and its range.
    """
    direct = direct_command(model)
    if direct:
        if not math.isfinite(motor):
            raise ValueError(f"{BY_QUANTITY[direct].name} must be finite, got {motor!r}")
        return
    for name, voltage in (("motor", motor), ("regulator", regulator)):
        # `not <=`: NaN is out of every range.
        if not 0.0 <= voltage <= 10.0:
            raise ValueError(f"{name}_voltage must lie in 0 to 10 V, got {voltage!r}")
