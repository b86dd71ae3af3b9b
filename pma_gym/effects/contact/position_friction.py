"""Dry friction that changes over the stroke: a bent guide, a worn or dry part of a screw."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class PositionFriction(NamedTuple):
    """Parameters of `friction_over_position` along a line."""

    slope: Annotated[float, Quantity("%/mm", -1e5, 1e5, "assumption: 0.5", 0.0, usual=0.5)]


class JointPositionFriction(NamedTuple):
    """Parameters of `friction_over_position` about an axis."""

    slope: Annotated[float, Quantity("%/deg", -1e5, 1e5, "assumption: 0.5", 0.0, usual=0.5)]


def friction_over_position(position, p):
    """Factor on the level of dry friction, linear in the position.

        factor = max(0, 1 + slope x)

    Dry friction is `coulomb_friction` or `joint_friction`, which keeps its level where the position
    reads 0; without it the factor does nothing. Trials must share one zero of the position.

    Args:
        position: x (m, rad), as it is read.
        p: PositionFriction or JointPositionFriction: slope (1/m, 1/rad).
    Returns:
        Factor, at least 0, so that friction never drives.
    Source:
        Ours: the first term of a friction that depends on the place.
    """
    return positive(friction_end(position, p))


def friction_end(position, p):
    """Signal at whose zero the friction ends.

    Args:
        position: x (m, rad).
        p: PositionFriction or JointPositionFriction: slope (1/m, 1/rad).
    Returns:
        1 + slope x.
    """
    return 1.0 + p.slope * position


_SIGNATURE = "step of force where the motion turns, which grows along the stroke"

POSITION_FRICTION = Effect(
    name="position_friction",
    port="dry_friction",
    parameters=PositionFriction,
    law=friction_over_position,
    breakpoint=friction_end,
    signature=_SIGNATURE,
)
JOINT_POSITION_FRICTION = Effect(
    name="joint_position_friction",
    port="joint_dry_friction",
    parameters=JointPositionFriction,
    law=friction_over_position,
    breakpoint=friction_end,
    signature=_SIGNATURE,
)
