"""Saturation of the drive: the amplifier limits the current and so the load."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

BOUNDLESS_N = 20e3
"""More than any `drive` within its bounds can command (10.1 kN)."""


class DriveSaturation(NamedTuple):
    """Parameters of `limited_load`."""

    limit: Annotated[
        float,
        Quantity(
            "N",
            10,
            BOUNDLESS_N,
            "assumption: 450, half of the 976 that 10 V asks for",
            BOUNDLESS_N,
            usual=450,
        ),
    ]


def limited_load(load, p):
    """Load after the limit of the current.

        L_out = min(L, limit)

    Args:
        load: load L that the drive would command without a limit (N).
        p: DriveSaturation: limit (N), torque constant times current limit over pulley radius.
    Returns:
        Load (N).
    Source:
        Every servo amplifier has a current limit; Serres 2008 gives none.
    """
    return load - positive(load - p.limit)


DRIVE_SATURATION = Effect(
    name="drive_saturation",
    port="drive_shape",
    parameters=DriveSaturation,
    law=limited_load,
    signature="load cell flat above some voltage: clipped tops",
)
