"""From actions to volts: what the agent asks for, checked, and how late the station hears it."""

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from pma_gym.envs.options import Options

HIGHEST_VOLTAGE = 10.0
"""What an action of 1 stands for (V); -1 stands for 0 V."""


class Volts(NamedTuple):
    """What the station is commanded for one control step (V, 0-10)."""

    motor: float
    regulator: float


class CommandLine:
    """The wire from the agent to the station, `action_delay_s` long.

    Args:
        options: the environment's options.

    Attributes:
        space: the action space.
        action: the last action, held to -1 to 1; at the start the action of the settled station.
        change: how far the last action moved an entry, at most (0 to 2).
    """

    def __init__(self, options: Options) -> None:
        """Size the action space."""
        self._size = 2 if options.regulator_action else 1
        self._delay = options.action_delay
        self.space = spaces.Box(-1.0, 1.0, (self._size,), np.float32)
        self.begin(0.0)

    def begin(self, regulator_voltage: float) -> Volts:
        """Start a trial from a settled station: no motor voltage, this regulator voltage (V)."""
        self._rest = Volts(0.0, regulator_voltage)
        self._wire = deque([self._rest] * self._delay)
        self.action = self._scaled(self._rest)
        self.change = 0.0
        return self._rest

    def send(self, action: object) -> Volts:
        """Take an action; return what the station hears in this control step.

        Raises:
            ValueError: an action of the wrong shape or kind, or not finite.
        """
        asked = self._checked(action)
        held = [min(max(value, -1.0), 1.0) for value in asked]
        self.change = max(abs(new - old) for new, old in zip(held, self.action, strict=True))
        self.action = held
        volts = [0.5 * HIGHEST_VOLTAGE * (value + 1.0) for value in held]
        self._wire.append(Volts(volts[0], volts[1] if self._size == 2 else self._rest.regulator))
        return self._wire.popleft()

    def action_for(
        self, motor_voltage: float, regulator_voltage: float | None
    ) -> NDArray[np.float64]:
        """The action that commands these voltages (V), held to 0-10 V."""
        regulator = self._rest.regulator if regulator_voltage is None else regulator_voltage
        return np.array(self._scaled(Volts(motor_voltage, regulator)))

    def _scaled(self, volts: Volts) -> list[float]:
        scaled = (2.0 / HIGHEST_VOLTAGE * value - 1.0 for value in volts[: self._size])
        return [min(max(value, -1.0), 1.0) for value in scaled]

    def _checked(self, action: object) -> list[float]:
        try:
            array = np.asarray(action, dtype=np.float64)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise ValueError(f"{self._rule()}; got {action!r}") from None
        if array.shape != (self._size,):
            raise ValueError(
                f"{self._rule()}; got shape {array.shape}: {action!r}; "
                f"give an array such as {np.zeros(self._size).tolist()}"
            )
        values = array.tolist()
        if not all(map(math.isfinite, values)):
            raise ValueError(
                f"{self._rule()}, all of them finite; got {values}; "
                "look for a division by zero or a diverged policy in what computes it"
            )
        return values

    def _rule(self) -> str:
        names = "motor voltage, regulator voltage" if self._size == 2 else "motor voltage"
        return (
            f"action must have shape ({self._size},): {names}, each -1 to 1 for "
            f"0 to {HIGHEST_VOLTAGE:g} V"
        )
