"""The part of an environment that a picture reads."""

from collections.abc import Mapping
from typing import Protocol

from pma_gym.engine.options import Options


class Scene(Protocol):
    """An environment in or after an episode, as far as a picture shows it.

    Attributes:
        options: the environment's options.
        truth: true contraction (m), rotation (rad), load (N) and pressure (Pa) by name.
        position: true position that the task asks for (m, rad or N m).
        error: true position less reference, in the same unit.
        motor_voltage, regulator_voltage: commands of the last step at the station (V).
        time: time since the trial began (s).
        ended_by: the limit that terminated the episode, in words; "" while none has.
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
