"""A drive whose gain differs between the two directions of its force."""

from typing import Annotated, NamedTuple

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


DIRECTIONAL_GAIN = Effect(
    name="directional_gain",
    port="drive_gain",
    parameters=DirectionalGain,
    law=gain_by_direction,
    signature="force that is missing in one direction in proportion to the command, at any speed",
)
