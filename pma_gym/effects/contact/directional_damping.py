"""Viscous friction that is larger in one direction: seal lips, ramps, one-way valves."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class DirectionalDamping(NamedTuple):
    """Parameters of `directional_force` along a line."""

    difference: Annotated[float, Quantity("N s/mm", -1e4, 1e4, "assumption: 0.02", 0.0, usual=0.02)]


class JointDirectionalDamping(NamedTuple):
    """Parameters of `directional_force` about an axis."""

    difference: Annotated[float, Quantity("N m s", -1e5, 1e5, "assumption: 0.01", 0.0, usual=0.01)]


def directional_force(velocity, p):
    """Difference of viscous friction between forward and backward motion.

        F = -difference / 2 |v|

    Args:
        velocity: speed v (m/s, rad/s).
        p: DirectionalDamping or JointDirectionalDamping: difference of the coefficients forwards
            and back (N s/m, N m s).
    Returns:
        Force (N, N m), backward in both directions of motion; the mean of the two directions is
        the viscous damping.
    Source:
        Ours: the part of a piecewise linear friction that is even in speed.
    """
    return -0.5 * p.difference * abs(velocity)


_SIGNATURE = "force that grows with speed and points the same way in both directions of motion"

DIRECTIONAL_DAMPING = Effect(
    name="directional_damping",
    port="contact_force",
    parameters=DirectionalDamping,
    law=directional_force,
    signature=_SIGNATURE,
)
JOINT_DIRECTIONAL_DAMPING = Effect(
    name="joint_directional_damping",
    port="joint_torque",
    parameters=JointDirectionalDamping,
    law=directional_force,
    signature=_SIGNATURE,
)
