"""Drag proportional to the square of speed: air, a fan, oil through an orifice."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class QuadraticDrag(NamedTuple):
    """Parameters of `drag_force` along a line."""

    coefficient: Annotated[
        float, Quantity("N s^2/mm^2", 0, 1e3, "assumption: 1 N at 100 mm/s", 0.0, usual=1e-4)
    ]


class JointDrag(NamedTuple):
    """Parameters of `drag_force` about an axis."""

    coefficient: Annotated[
        float, Quantity("N m s^2", 0, 1e5, "assumption: 0.01 N m at 3 rad/s", 0.0, usual=1e-3)
    ]


def drag_force(velocity, p):
    """Force against the motion, proportional to the square of its speed.

        F = -coefficient v |v|

    Args:
        velocity: speed v (m/s, rad/s).
        p: QuadraticDrag or JointDrag: coefficient (N s^2/m^2, N m s^2).
    Returns:
        Force (N, N m); positive in the positive direction of the speed.
    Source:
        Textbooks on fluid mechanics: drag at high Reynolds numbers.
    """
    return -p.coefficient * velocity * abs(velocity)


_SIGNATURE = (
    "force against the motion that grows with the square of speed, and hardly any when slow"
)

QUADRATIC_DRAG = Effect(
    name="quadratic_drag",
    port="contact_force",
    parameters=QuadraticDrag,
    law=drag_force,
    signature=_SIGNATURE,
)
JOINT_DRAG = Effect(
    name="joint_drag",
    port="joint_torque",
    parameters=JointDrag,
    law=drag_force,
    signature=_SIGNATURE,
)
