"""A force that never changes: a weight, a preload, a load cell's zero."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class ConstantForce(NamedTuple):
    """Parameters of `constant_force`."""

    force: Annotated[float, Quantity("N", -1e6, 1e6, "assumption: 5", 0.0, usual=5)]


def constant_force(p):
    """Force that depends on nothing.

        F = force

    Args:
        p: ConstantForce: force (N).
    Returns:
        Force (N); positive in the direction of contraction.
    Source:
        None needed. Logs in one direction cannot tell it from dry friction.
    """
    return p.force


CONSTANT_FORCE = Effect(
    name="constant_force",
    port="contact_force",
    parameters=ConstantForce,
    law=constant_force,
    signature="the same force at every position, speed, direction and pressure",
)
