"""Small commands move nothing: the drive's amplifier and brushes swallow them."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

CATCHING_UP = 2.0
"""Slope with which the load catches up beyond the dead zone: our assumption."""


class DriveDeadZone(NamedTuple):
    """Parameters of `load_beyond_dead_zone`."""

    width: Annotated[
        float, Quantity("N", 0, 200, "assumption: 0.05-0.2 V, so 5-20 at 97.84 N/V", 0.0, usual=15)
    ]


def load_beyond_dead_zone(load, p):
    """Load that a drive with a dead zone asks for.

        L_out = min(L, 2 max(0, L - width))

    Nothing up to the width; from twice the width on the load is what it was. A dead zone that
    stayed behind for ever would be an offset of `drive`, and no data could tell them apart.

    Args:
        load: load L that the drive would ask for without it (N), not negative.
        p: DriveDeadZone: width (N).
    Returns:
        Load (N), not negative.
    Source:
        Our form, in two straight lines.
    """
    late = CATCHING_UP * positive(load - p.width)
    return where(late < load, late, load)


DRIVE_DEAD_ZONE = Effect(
    name="drive_dead_zone",
    port="drive_shape",
    parameters=DriveDeadZone,
    law=load_beyond_dead_zone,
    signature="load cell at 0 up to some voltage, then on its old line: a missing start",
)
