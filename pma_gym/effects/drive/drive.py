"""The servo drive in torque mode: a voltage commands a load in the cable."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Drive(NamedTuple):
    """Parameters of `drive_load`."""

    gain: Annotated[
        float,
        Quantity(
            "N/V", 1, 1000, "Serres 2008, fit to the measured loads of I3: 97.84", usual=97.84
        ),
    ]
    offset: Annotated[
        float, Quantity("N", -100, 100, "Serres 2008, the same fit: -2.0", usual=-2.0)
    ]


def drive_load(motor_voltage, p):
    """Load that the drive commands, never below zero: it cannot unwind the cable.

        L = max(0, gain V + offset)

    Args:
        motor_voltage: command V (V).
        p: Drive: gain (N/V), offset (N).
    Returns:
        Load L at the pulley's radius (N).
    Source:
        Straight line through the measured loads of Serres 2008, table I3 (R2 0.998); the gains
        of table 1 fit neither.
    """
    return positive(p.gain * motor_voltage + p.offset)


DRIVE = Effect(
    name="drive",
    port="drive",
    parameters=Drive,
    law=drive_load,
    signature="load cell proportional to voltage",
)
