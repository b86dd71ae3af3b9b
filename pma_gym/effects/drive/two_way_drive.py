"""A drive on a rigid link, which pushes and pulls."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class TwoWayDrive(NamedTuple):
    """Parameters of `two_way_load`."""

    gain: Annotated[
        float,
        Quantity("N/V", 0.01, 1e5, "assumption: 100, which 0-10 V make -500 to 500 N", usual=100),
    ]
    middle: Annotated[float, Quantity("V", -10, 20, "assumption: 5, the middle of 0-10 V", usual=5)]

    @property
    def offset(self) -> float:
        """Load at 0 V (N)."""
        return -self.gain * self.middle


def two_way_load(motor_voltage, p):
    """Load of the drive, of either sign.

        L = gain (V - middle)

    Args:
        motor_voltage: command V (V).
        p: TwoWayDrive: gain (N/V), middle (V).
    Returns:
        Load L (N); positive pulls the slide out, against the direction of contraction.
    Source:
        Assumption: the current loop is much faster than the mechanics.
    """
    return p.gain * (motor_voltage - p.middle)


TWO_WAY_DRIVE = Effect(
    name="two_way_drive",
    port="two_way_drive",
    parameters=TwoWayDrive,
    # A position tells its ratio to the mass alone.
    held=("gain",),
    law=two_way_load,
    signature="acceleration proportional to voltage, either way",
)
