"""Springs: linear, and hardening with the cube of the displacement."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Spring(NamedTuple):
    """Parameters of `linear_spring` along a line."""

    stiffness: Annotated[float, Quantity("N/mm", 0, 1e6, "assumption: 1", 0.0, usual=1)]
    rest: Annotated[float, Quantity("mm", -1e5, 1e5, "where it is relaxed: 0", usual=0.0)]


class JointSpring(NamedTuple):
    """Parameters of `linear_spring` about an axis."""

    stiffness: Annotated[float, Quantity("N m/rad", 0, 1e6, "assumption: 0.5", 0.0, usual=0.5)]
    rest: Annotated[float, Quantity("deg", -1e4, 1e4, "where it is relaxed: 0", usual=0.0)]


class HardeningSpring(NamedTuple):
    """Parameters of `cubic_spring` along a line."""

    cubic: Annotated[float, Quantity("N/mm^3", 0, 1e6, "assumption: 1e-4", 0.0, usual=1e-4)]


class JointHardeningSpring(NamedTuple):
    """Parameters of `cubic_spring` about an axis."""

    cubic: Annotated[float, Quantity("N m/rad^3", 0, 1e6, "assumption: 0.5", 0.0, usual=0.5)]


def linear_spring(position, p):
    """Force of a linear spring.

        F = -stiffness (x - rest)

    Args:
        position: x (m, rad).
        p: Spring or JointSpring: stiffness (N/m, N m/rad), rest (m, rad).
    Returns:
        Force (N, N m), towards the position where the spring is relaxed.
    Source:
        Hooke's law.
    """
    return -p.stiffness * (position - p.rest)


def cubic_spring(position, p):
    """Force of a spring without a linear part.

        F = -cubic x^3

    Args:
        position: displacement x from the relaxed position (m, rad).
        p: HardeningSpring or JointHardeningSpring: cubic (N/m^3, N m/rad^3).
    Returns:
        Force (N, N m), towards the relaxed position.
    Source:
        G. Duffing 1918.
    """
    return -p.cubic * position * position * position


_LINEAR = "force in proportion to the position"
_CUBIC = "force that grows with the cube of the position, and hardly any in the middle"

SPRING = Effect(
    name="spring",
    port="contact_force",
    parameters=Spring,
    law=linear_spring,
    signature=_LINEAR,
)
JOINT_SPRING = Effect(
    name="joint_spring",
    port="joint_load",
    parameters=JointSpring,
    law=linear_spring,
    signature="torque in proportion to the angle",
)
HARDENING_SPRING = Effect(
    name="hardening_spring",
    port="contact_force",
    parameters=HardeningSpring,
    law=cubic_spring,
    signature=_CUBIC,
)
JOINT_HARDENING_SPRING = Effect(
    name="joint_hardening_spring",
    port="joint_load",
    parameters=JointHardeningSpring,
    law=cubic_spring,
    signature=_CUBIC,
)
