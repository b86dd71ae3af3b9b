"""Where a plant stands: its state, its time, the commands that it received last."""

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
    """Where a plant stands.

    Attributes:
        state: the state vector (SI), changed in place by `Plant.step`.
        zero_contraction: contraction x0 at which the trial began with no load (m); extension is
            counted from it.
        time: time since the trial began (s).
        size: size that the next internal step will have (s), if its error allows.
        commands: motor and regulator voltage that it received last (V), or None.
    """

    state: np.ndarray
    zero_contraction: float
    time: float = 0.0
    size: float = FIRST_S
    commands: tuple[float, float] | None = None

    def receive(self, motor_voltage: float, regulator_voltage: float) -> None:
        """Take commands (V) in: where they jump, the next internal step begins smaller."""
        commands = (motor_voltage, regulator_voltage)
        before = self.commands or commands
        jump = max(abs(new - old) for new, old in zip(commands, before, strict=True))
        self.size, self.commands = first_size(self.size, jump), commands


def check_commands(model: Model, motor: float, regulator: float) -> None:
    """Refuse commands that no drive or regulator takes.

    Args:
        model: says whether its drive takes a voltage of 0-10 V, or its command as it comes.
        motor: the motor's command (V, or SI of what its drive takes).
        regulator: the regulator's (V).
    Raises:
        ValueError: names the command, what came, and what may.
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
