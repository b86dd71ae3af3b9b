"""Conversion between actions and voltages, with checks of an agent's actions."""

import math
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from pma_gym.engine.options import Options
from pma_gym.tasks import Actuator

HIGHEST_VOLTAGE = 10.0
"""Voltage (V) of an action of 1; -1 is 0 V."""


class CommandLine:
    """Action space of an agent, and conversion of voltages to actions.

    Args:
        options: the environment's options.
        actuator: actuator of the (first) action.

    Attributes:
        space: the action space.
    """

    def __init__(self, options: Options, actuator: Actuator = "motor") -> None:
        """Set the size of the action space."""
        self._actuator = actuator
        self._size = 2 if options.regulator_action else 1
        self.space = self._box(self._size)
        self.begin(0.0)

    @staticmethod
    def _box(size: int) -> "spaces.Box[Any]":
        return spaces.Box(-1.0, 1.0, (size,), np.float32)

    def begin(self, regulator_voltage: float) -> None:
        """Start a trial in equilibrium at a regulator voltage (V)."""
        self._rest = regulator_voltage

    def action_for(self, voltage: float, regulator_voltage: float | None) -> NDArray[np.float64]:
        """Return the action for given voltages (V), limited to 0-10 V."""
        regulator = self._rest if regulator_voltage is None else regulator_voltage
        volts = (voltage, regulator)[: self._size]
        scaled = (2.0 / HIGHEST_VOLTAGE * value - 1.0 for value in volts)
        return np.array([min(max(value, -1.0), 1.0) for value in scaled])

    def checked(self, action: object) -> list[float]:
        """Check an action and return its entries.

        Raises:
            ValueError: an action of the wrong shape or kind, or not finite.
        """
        try:
            array = np.asarray(action)
            if array.dtype.kind not in "fiu":
                raise TypeError
            array = array.astype(np.float64)
        except (TypeError, ValueError):
            raise ValueError(f"{self._rule()}; got {action!r}; give real numbers") from None
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
        both = self._size == 2
        names = "motor voltage, regulator voltage" if both else f"{self._actuator} voltage"
        return (
            f"action must have shape ({self._size},): {names}, each -1 to 1 for "
            f"0 to {HIGHEST_VOLTAGE:g} V"
        )
