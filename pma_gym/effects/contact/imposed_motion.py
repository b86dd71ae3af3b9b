"""A motion that an external drive imposes: a tensile tester, a cylinder, a shaker."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

FOLLOWING = 0.5
"""Corner frequency of the states that follow the motion, in bandwidths of its record.
`motion_command` compensates their lag. A higher corner follows the straight lines between the rows
of the record and not the motion. For a sine of 5 Hz at 250 rows a second and a bandwidth of 100 Hz
the speed errs by 0.07 %, with a corner of twice the bandwidth by 2 %."""

_TURN = 6.283185307179586


class ImposedMotion(NamedTuple):
    """Parameters of `imposed_acceleration`."""

    bandwidth: Annotated[
        float,
        Quantity(
            "Hz", 1e-3, 1e5, "assumption: 10, testers turn within a tenth of a second", usual=10
        ),
    ]


def following_rate(p):
    """Corner frequency (rad/s) of the states that follow the motion."""
    return _TURN * FOLLOWING * p.bandwidth


def imposed_acceleration(command, contraction, velocity, p):
    """Acceleration of the moved part, which follows a command without overshoot.

        x'' = w^2 (c - x) - 2 w x',   w = pi bandwidth

    Args:
        command: commanded position c (m), the record advanced by the lag of the states.
        contraction: position x (m).
        velocity: its rate (m/s).
        p: ImposedMotion: bandwidth (Hz) at which the record's amplitude is halved.
    Returns:
        Acceleration (m/s^2).
    Source:
        Two equal real poles: the fastest that does not overshoot.
    """
    corner = following_rate(p)
    return corner * (corner * (command - contraction) - 2.0 * velocity)


IMPOSED_MOTION = Effect(
    name="imposed_motion",
    port="imposed_motion",
    parameters=ImposedMotion,
    law=imposed_acceleration,
    held=("bandwidth",),
    signature="the motion is the input: it is the record, smoothed without a lag",
)
