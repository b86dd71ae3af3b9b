"""A drive whose gain differs between the two directions of its force."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class DirectionalGain(NamedTuple):
    """Parameters of `gain_by_direction`."""

    difference: Annotated[
        float, Quantity("%", -150, 150, "assumption: 5, brushes or a piston's rod", 0.0, usual=5)
    ]


def gain_by_direction(drive_force, p):
    """Force that a drive gives in excess forwards, and too little backwards.

        F = difference / 2 |F_drive|

    Args:
        drive_force: force or torque of the drive with its mean gain F_drive (N, N m).
        p: DirectionalGain: difference of the gains over their mean.
    Returns:
        Force (N, N m); positive forwards.
    Source:
        None: a gain that depends on the command's sign.
    """
    return 0.5 * p.difference * abs(drive_force)


def gain_breakpoint(drive_force, p):
    """Signal at whose zero the slope of the law jumps: the force of the drive.

    Args:
        drive_force: force or torque of the drive with its mean gain (N, N m).
        p: DirectionalGain: difference.
    Returns:
        The force; 1 where the effect is absent.
    """
    there = where(abs(p.difference) > 0.0, 1.0, 0.0)
    return there * drive_force + (1.0 - there)


DIRECTIONAL_GAIN = Effect(
    name="directional_gain",
    port="drive_gain",
    parameters=DirectionalGain,
    law=gain_by_direction,
    breakpoint=gain_breakpoint,
    signature="force that is missing in one direction in proportion to the command, at any speed",
)
