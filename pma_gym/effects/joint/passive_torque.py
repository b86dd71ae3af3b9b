"""Passive torques at a joint: weight, viscous damping, dry friction."""

import math
from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import cosine
from pma_gym.effects.effect import Effect
from pma_gym.effects.slide.coulomb_friction import (
    friction_breakpoint,
    friction_force,
    friction_path,
    stribeck_breakpoint,
)
from pma_gym.units import Quantity

_QUARTER = 0.5 * math.pi


class JointWeight(NamedTuple):
    """Parameters of `weight_torque`."""

    moment: Annotated[
        float, Quantity("N m", 0, 1e5, "assumption: 0.5, 0.5 kg on 0.1 m", 0.0, usual=0.5)
    ]
    offset: Annotated[
        float, Quantity("deg", -360, 360, "where the angle's zero is: 0, hanging", usual=0.0)
    ]


def weight_torque(angle, p):
    """Torque of a weight on an arm.

        T = -moment sin(q + offset)

    Args:
        angle: of the joint q (rad).
        p: JointWeight: moment m g l (N m), offset (rad) of the angle's zero from the lowest point.
    Returns:
        Torque (N m), towards the lowest point.
    Source:
        Statics of a rigid body about a fixed axis.
    """
    return -p.moment * cosine(angle + p.offset - _QUARTER)


class JointDamping(NamedTuple):
    """Parameters of `damping_torque`."""

    coefficient: Annotated[float, Quantity("N m s", 0, 1e5, "assumption: 0.01", 0.0, usual=0.01)]


def damping_torque(spin, p):
    """Viscous torque: T = -coefficient w.

    Args:
        spin: speed of the joint w (rad/s).
        p: JointDamping: coefficient (N m s).
    Returns:
        Torque (N m), against the motion.
    Source:
        Newton's law of viscosity.
    """
    return -p.coefficient * spin


class JointFriction(NamedTuple):
    """Parameters of `friction_force` for a torque about an axis."""

    static: Annotated[float, Quantity("N m", 0, 1e4, "assumption: 0.02", 0.0, usual=0.02)]
    dynamic: Annotated[float, Quantity("N m", 0, 1e4, "assumption: 0.015", 0.0, usual=0.015)]
    stribeck_speed: Annotated[float, Quantity("deg/s", 0.01, 1e5, "assumption: 5 deg/s", usual=5)]
    presliding: Annotated[
        float, Quantity("deg", 1e-5, 10, "assumption: 0.02 at full static torque", usual=0.02)
    ]


JOINT_WEIGHT = Effect(
    name="joint_weight",
    port="joint_load",
    parameters=JointWeight,
    law=weight_torque,
    signature="torque that depends on the angle, as its sine",
)
JOINT_DAMPING = Effect(
    name="joint_damping",
    port="joint_torque",
    parameters=JointDamping,
    law=damping_torque,
    signature="torque in proportion to the speed, the same in both directions",
)
JOINT_FRICTION = Effect(
    name="joint_friction",
    port="joint_torque",
    parameters=JointFriction,
    held=("presliding",),
    scanned=("presliding",),
    ties=(("static", "dynamic", "stribeck_speed"),),
    law=friction_force,
    rate_independent_law=friction_path,
    path_breakpoint=friction_breakpoint,
    breakpoint=stribeck_breakpoint,
    signature="odd step of torque at zero speed; the joint sticks under small changes of torque",
)
