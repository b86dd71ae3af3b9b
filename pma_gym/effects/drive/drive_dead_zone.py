"""Dead zone of a drive: small commands move nothing."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

CATCHING_UP = 2.0
"""Slope beyond the dead zone if a model file does not give one: our assumption. Files from before
the slope was a parameter have this value."""


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
    """Load that a drive with a dead zone commands.

        L_out = min(L, slope max(0, L - width))

    The load is 0 up to the width, and equals L from slope / (slope - 1) times the width on (twice
    the width at a slope of 2). A dead zone that never catches up (slope 1) would equal an offset of
    `drive`; no data could distinguish the two. At a width of 0 the slope has no effect.

    Args:
        load: load L that the drive would command without a dead zone (N), not negative.
        p: DriveDeadZone: width (N), slope (1), more than 1.
    Returns:
        Load (N), not negative.
    Source:
        Our form, in two straight lines.
    """
    late = p.slope * positive(load - p.width)
    return where(late < load, late, load)


class DriveDeadBand(NamedTuple):
    """Parameters of `force_beyond_dead_band`; a drive of either sign never catches up."""

    width: Annotated[
        float,
        Quantity(
            *(
                "N or N m",
                0,
                1e6,
                "assumption: 1, some per cent of the largest command",
            ),
            neutral=0.0,
            usual=1,
        ),
    ]
    slope = 1.0


def force_beyond_dead_band(load, p):
    """Force of a drive of either sign that takes a dead band off every command.

        F_out = sign(F) max(0, |F| - width)

    Args:
        load: force or torque F of the drive without a dead band (N, N m).
        p: DriveDeadBand: width (N, N m).
    Returns:
        Force (N, N m).
    Source:
        `load_beyond_dead_zone` at a slope of 1, either way.
    """
    beyond = load_beyond_dead_zone(abs(load), p)
    return where(load < 0.0, -beyond, beyond)


def dead_band_breakpoints(load, p):
    """Signals at whose zeros the slope of the law jumps: the force beyond either end of the band.

    Args:
        load: force or torque of the drive without a dead band (N, N m).
        p: DriveDeadBand.
    Returns:
        Both (N, N m); 1 where there is no dead band.
    """
    there = where(p.width > 0.0, 1.0, 0.0)
    return there * (load - p.width) + (1.0 - there), there * (load + p.width) + (1.0 - there)


DRIVE_DEAD_ZONE = Effect(
    name="drive_dead_zone",
    port="drive_shape",
    parameters=DriveDeadZone,
    law=load_beyond_dead_zone,
    signature="load cell at 0 up to some voltage, then on its old line: a missing start",
)
DRIVE_DEAD_BAND = Effect(
    name="drive_dead_band",
    port="two_way_shape",
    parameters=DriveDeadBand,
    law=force_beyond_dead_band,
    breakpoint=dead_band_breakpoints,
    signature="force that is missing by the same amount, against the sign of the command",
)
