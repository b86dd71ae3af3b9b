"""Interface of an environment for pictures.

Size of pictures.
"""

from collections.abc import Mapping
from numbers import Integral
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


USUAL_WIDTH = 800
"""Usual width of a picture (pixels); every picture is half as high as wide."""

LEAST_WIDTH, MOST_WIDTH = 400, 3200


def check_render_width(width: object) -> int:
    """Check the width of pictures and return it.

    It must be a multiple of 4, so that the height is even, as H.264 videos need.

    Raises:
        ValueError: with the rule, the unit and the invalid value.
    """
    whole = isinstance(width, Integral) and not isinstance(width, bool)
    if not whole or not LEAST_WIDTH <= int(width) <= MOST_WIDTH or int(width) % 4:  # type: ignore[call-overload]
        raise ValueError(
            f"render_width must be a multiple of 4 in {LEAST_WIDTH}-{MOST_WIDTH} pixels (a picture "
            f"is half as high), got {width!r}; leave it out for {USUAL_WIDTH}"
        )
    return int(width)  # type: ignore[call-overload]
