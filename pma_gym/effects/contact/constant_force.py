"""A constant force: a weight, a preload, a load cell's zero offset."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class ConstantForce(NamedTuple):
    """Parameters of `constant_force`."""

    force: Annotated[float, Quantity("N", -1e6, 1e6, "assumption: 5", 0.0, usual=5)]


class ConstantTorque(NamedTuple):
    """Parameters of `constant_force` about an axis."""

    torque: Annotated[float, Quantity("N m", -1e6, 1e6, "assumption: 0.05", 0.0, usual=0.05)]

    @property
    def force(self) -> float:
        """The torque (N m), under the name that the law uses."""
        return self.torque


def constant_force(p):
    """Constant force.

        F = force

    Args:
        p: ConstantForce or ConstantTorque: force (N, N m).
    Returns:
        Force (N, N m); positive in the direction in which the position grows.
    Source:
        None needed. Logs in one direction of motion cannot distinguish it from dry friction.
        Dry friction of F1 forwards and F2 backwards is dry friction of (F1 + F2) / 2 and a constant
        force of (F2 - F1) / 2.
    """
    return p.force


CONSTANT_FORCE = Effect(
    name="constant_force",
    port="contact_force",
    parameters=ConstantForce,
    law=constant_force,
    signature=(
        "the same force at every position, speed, direction and pressure; beside dry friction, "
        "friction that differs by direction"
    ),
)
CONSTANT_TORQUE = Effect(
    name="constant_torque",
    port="joint_load",
    parameters=ConstantTorque,
    law=constant_force,
    signature=(
        "the same torque at every angle, speed and direction; beside dry friction, friction that "
        "differs by direction"
    ),
)
