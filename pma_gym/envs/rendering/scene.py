"""Interface of an environment for pictures."""

from collections.abc import Mapping
from typing import Protocol

from pma_gym.engine.options import Options


class Scene(Protocol):
    """State of an environment, during or after an episode, that a picture shows.

    Attributes:
        options: the environment's options.
        truth: true contraction (m), rotation (rad), load (N) and pressure (Pa) by name.
        position: true position of the controlled quantity (m, rad or N m).
        error: true position minus reference, in the same unit.
        motor_voltage, regulator_voltage: commands at the station in the last step (V).
        time: time since the trial began (s).
        ended_by: name of the limit that terminated the episode; "" if none has.
    """

    options: Options

    @property
    def truth(self) -> Mapping[str, float]: ...  # noqa: D102

    @property
    def position(self) -> float: ...  # noqa: D102

    @property
    def error(self) -> float: ...  # noqa: D102

    @property
    def motor_voltage(self) -> float: ...  # noqa: D102

    @property
    def regulator_voltage(self) -> float: ...  # noqa: D102

    @property
    def time(self) -> float: ...  # noqa: D102

    @property
    def ended_by(self) -> str: ...  # noqa: D102
