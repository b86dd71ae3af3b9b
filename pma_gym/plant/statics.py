"""Static muscle forces and contractions for arrays of pressures and loads.

The condition of a running plant: its state, its time and its last commands.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pma_gym.codegen.trace import as_numpy
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.effects.effect import signals
from pma_gym.integrator.step_attempt import first_size
from pma_gym.plant.model import Model
from pma_gym.plant.program import FIRST_S
from pma_gym.plant.sensors import active_commands, direct_command

_HALVINGS = 48
"""Bisections of a 120 mm bracket, to below 1e-12 mm."""


def muscle_force(model: Model) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Static force of a model's muscle, with all effects' states at zero.

    Args:
        model: a station's model.
    Returns:
        Function of pressure (Pa) and contraction (m), arrays of one shape, that returns the force
        (N), positive when it shortens the muscle.
    """
    laws = []
    for effect in model.effects.values():
        if effect.port == "muscle_force" and effect.law and "memory" not in signals(effect.law):
            names = signals(effect.law)
            laws.append((as_numpy(effect.law), names, model.parameters[effect.name]))

    def force(pressure: np.ndarray, contraction: np.ndarray) -> np.ndarray:
        total = np.zeros(np.broadcast(pressure, contraction).shape)
        known = {"pressure": pressure, "contraction": contraction, "velocity": 0.0 * total}
        for law, names, parameters in laws:
            total = total + law(*(parameters if n == "p" else known[n] for n in names))
        return total

    return force


def contraction_at(
    force: Callable[[np.ndarray, np.ndarray], np.ndarray],
    pressure: np.ndarray,
    load: np.ndarray,
    shortest: float = -0.03,
    longest: float = 0.09,
) -> np.ndarray:
    """Find the contraction at which a force law balances a load, by bisection.

    Args:
        force: function of pressure (Pa) and contraction (m) giving N; falls with contraction.
        pressure: gauge pressures (Pa), shape (n,).
        load: loads (N), shape (n,).
        shortest: lower end of the search (m).
        longest: upper end (m).
    Returns:
        Contraction (m), shape (n,); an end of the search where the law never balances the load.
    """
    shape = np.broadcast(pressure, load).shape
    low, high = np.full(shape, shortest), np.full(shape, longest)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        pulls = force(pressure, middle) > load
        low, high = np.where(pulls, middle, low), np.where(pulls, high, middle)
    return 0.5 * (low + high)


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
    if model.rig.commands:
        for command, value in zip(active_commands(model), (motor, regulator), strict=True):
            if command:
                column = BY_QUANTITY[command.name]
                low, high = column.limits or (-math.inf, math.inf)
                if not (math.isfinite(value) and low <= value <= high):
                    raise ValueError(
                        f"{column.name} must lie in {low:g} to {high:g}, got {value!r}"
                    )
        return
    for name, voltage in (("motor", motor), ("regulator", regulator)):
        # `not <=`: NaN is out of every range.
        if not 0.0 <= voltage <= 10.0:
            raise ValueError(f"{name}_voltage must lie in 0 to 10 V, got {voltage!r}")
