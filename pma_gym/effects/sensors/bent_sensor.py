"""Sensors of a position whose scale is bent: its readings grow with the square of the position.

The sensor of a model without its table has no lag, and may be bent all the same.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.effects.sensors.sensors import ENCODER, LVDT
from pma_gym.units import Quantity

_SOURCE = "assumption: linear to 1 % at 10 mm"


class LvdtBend(NamedTuple):
    """Bend of a displacement sensor."""

    curvature: Annotated[float, Quantity("%/mm", -1000, 1000, _SOURCE, 0.0, usual=0.1)]


class EncoderBend(NamedTuple):
    """Bend of a joint's angle sensor, as of a magnet that sits beside the axis."""

    curvature: Annotated[
        float, Quantity("%/deg", -100, 100, "assumption: 1 % at 20 deg", 0.0, usual=0.05)
    ]


def curvature_error(signal, p):
    """Error of a bent sensor.

        error = curvature s^2

    Args:
        signal: the true position s (m, rad), from where the sensor is straight.
        p: the bend: curvature (1/m, 1/rad).
    Returns:
        Error (m, rad), added to the true position.
    Source:
        First term of a calibration curve beyond its line.
    """
    return p.curvature * signal * signal


def _bent(sensor: Effect, parameters: type) -> Effect:
    return Effect(
        name=f"{sensor.name}_bend",
        port=sensor.port.replace("sensor:", "mount:"),
        parameters=parameters,
        law=curvature_error,
        signature=(
            "readings are off by the square of the position, the same at every speed and force, "
            "so a fast motion's waves look higher at one end"
        ),
    )


BENT_SENSORS: tuple[Effect, ...] = (_bent(LVDT, LvdtBend), _bent(ENCODER, EncoderBend))
"""Bends of the position sensors of free rigs, as effects of the catalogue."""
