"""Torque ripple of a motor: as many periods per turn as it has slots or commutator bars."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import cosine
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class TorqueRipple(NamedTuple):
    """Parameters of `ripple_load`."""

    amplitude: Annotated[
        float,
        Quantity("%", 0, 1, "servo motors' data sheets: at most 1 of the torque", 0.0, usual=1),
    ]
    periods: Annotated[
        float, Quantity("1", 4, 60, "assumption: 24 a turn, slots or commutator bars", usual=24)
    ]
    phase: Annotated[
        float, Quantity("deg", -360, 360, "where the motor happens to stand: 0", usual=0)
    ]


def ripple_load(load_arriving, angle, p):
    """Load in addition to the motor's mean load, as a function of the pulley's angle.

        L = amplitude L_mean cos(periods theta + phase)

    Args:
        load_arriving: mean load L_mean (N).
        angle: pulley angle theta (rad) from its position without load.
        p: TorqueRipple: amplitude (share), periods per turn, phase (rad).
    Returns:
        Load (N), added.
    Source:
        Textbooks on servo motors: ripple proportional to the current.
    """
    return p.amplitude * load_arriving * cosine(p.periods * angle + p.phase)


TORQUE_RIPPLE = Effect(
    name="torque_ripple",
    port="drive_ripple",
    parameters=TorqueRipple,
    law=ripple_load,
    signature="load cell periodic in the angle, whatever the speed",
)
