"""Play of a gear or coupling between an axis and its position sensor, which friction holds.

The law is that of the potentiometer's play; the position in it is that of a stop operator, exact
and without a rounding.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import where
from pma_gym.effects.effect import Effect
from pma_gym.effects.muscle.prandtl_ishlinskii import StopOperator, stop_breakpoint, stop_path
from pma_gym.effects.sensors.potentiometer_backlash import play
from pma_gym.effects.sensors.sensors import ENCODER, LVDT
from pma_gym.units import Quantity


class LvdtBacklash(NamedTuple):
    """Play before a displacement sensor."""

    width: Annotated[
        float, Quantity("mm", 0, 100, "assumption: 0.05-0.2 for a rack or cable", 0.0, usual=0.1)
    ]


class EncoderBacklash(NamedTuple):
    """Play before a joint's angle sensor."""

    width: Annotated[float, Quantity("deg", 0, 45, "assumption: 0.1-1 for a gear", 0.0, usual=0.2)]


def _stops(p):  # noqa: ANN001, ANN202
    half = where(p.width > 0.0, 0.5 * p.width, 1.0)
    return StopOperator(p.width, 1.0, half, 0.0)


def gear_path(memory, travel, direction, p):
    """Position in the play after a travel without a reversal.

        z = clip(z_0 + 2 travel / width, -1, 1)

    Args:
        memory: z_0 where the travel began, -1 at one stop to 1 at the other.
        travel: displacement since then (m, rad).
        direction: 1 where the position grows, else -1.
        p: the play: width (m, rad), from stop to stop.
    Returns:
        z after it.
    """
    return stop_path(memory, travel, direction, _stops(p))


def gear_breakpoint(memory, direction, p):
    """Distance to the stop.

    Args:
        memory: z where the travel begins.
        direction: 1 where the position grows, else -1.
        p: the play.
    Returns:
        Distance (m, rad), 0 at the stop or without play.
    """
    return stop_breakpoint(memory, direction, _stops(p))


def _geared(sensor: Effect, parameters: type) -> Effect:
    return Effect(
        name=f"{sensor.name}_backlash",
        port=sensor.port.replace("sensor:", "mount:"),
        parameters=parameters,
        law=play,
        rate_independent_law=gear_path,
        path_breakpoint=gear_breakpoint,
        signature=(
            "readings stand still after every turn, over the same distance at every force and "
            "speed, while the axis goes on"
        ),
    )


SENSOR_BACKLASHES: tuple[Effect, ...] = (
    _geared(LVDT, LvdtBacklash),
    _geared(ENCODER, EncoderBacklash),
)
"""Plays before the position sensors of free rigs, as effects of the catalogue."""
