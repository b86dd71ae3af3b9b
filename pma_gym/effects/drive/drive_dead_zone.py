"""Small commands move nothing: the drive's amplifier and brushes swallow them."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

CATCHING_UP = 2.0
"""Slope with which the load catches up where a model file does not say: our assumption, and what
files meant before the slope was a parameter."""


class DriveDeadZone(NamedTuple):
    """Parameters of `load_beyond_dead_zone`."""

    width: Annotated[
        float, Quantity("N", 0, 200, "assumption: 0.05-0.2 V, so 5-20 at 97.84 N/V", 0.0, usual=15)
    ]
    slope: Annotated[
        float,
        Quantity("1", 1.2, 4, "assumption: caught up at 6 to 1.3 times the width", usual=2),
    ] = CATCHING_UP


def load_beyond_dead_zone(load, p):
    """Load that a drive with a dead zone asks for.

        L_out = min(L, slope max(0, L - width))

    Nothing up to the width; from slope / (slope - 1) times the width on, twice it at a slope of 2,
    the load is what it was. A dead zone that stayed behind for ever (slope 1) would be an offset of
    `drive`, and no data could tell them apart. Without a width the slope does nothing.

    Args:
        load: load L that the drive would ask for without it (N), not negative.
        p: DriveDeadZone: width (N), slope (1), more than 1.
    Returns:
        Load (N), not negative.
    Source:
        Our form, in two straight lines.
    """
    late = p.slope * positive(load - p.width)
    return where(late < load, late, load)


DRIVE_DEAD_ZONE = Effect(
    name="drive_dead_zone",
    port="drive_shape",
    parameters=DriveDeadZone,
    law=load_beyond_dead_zone,
    signature="load cell at 0 up to some voltage, then on its old line: a missing start",
)
