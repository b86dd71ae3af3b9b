"""Dry friction in the bearing of the motor, before the load cell."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class BearingFriction(NamedTuple):
    """Parameters of `bearing_drag`."""

    force: Annotated[
        float,
        Quantity("N", 0, 200, "assumption: 5 at the pulley, 0.13 N m at 25.4 mm", 0.0, usual=5),
    ]
    presliding: Annotated[
        float, Quantity("deg", 0.01, 20, "assumption: 0.5 to 63 % of the force", usual=0.5)
    ]


def bearing_drag(memory):
    """Load that bearing friction takes from the load at the pulley.

        L = -f

    Args:
        memory: friction f (N at the pulley's radius), positive against winding in.
    Returns:
        Load (N), added.
    Source:
        Dahl 1968.
    """
    return -memory


def bearing_rate(spin, memory, p):
    """Rate of the friction: f' = (force theta' - |theta'| f) / presliding.

    The friction depends on the distance turned, not on speed, and tends to the force in the
    direction of motion. At a force of 0 it stays exactly 0.

    Args:
        spin: rate of the pulley's angle theta' (rad/s).
        memory: friction f (N).
        p: BearingFriction: force (N), presliding (rad).
    Returns:
        (source, decay) with f' = source - decay * f (N/s).
    """
    share = 1.0 / p.presliding
    return share * p.force * spin, share * abs(spin)


def bearing_turn(spin, p):
    """Event function: the friction changes form where the pulley reverses.

    Args:
        spin: rate of the pulley's angle (rad/s).
        p: BearingFriction.
    Returns:
        The rate (rad/s); 1 where there is no friction.
    """
    there = where(p.force > 0.0, 1.0, 0.0)
    return there * spin + (1.0 - there)


BEARING_FRICTION = Effect(
    name="bearing_friction",
    port="drive_ripple",
    parameters=BearingFriction,
    law=bearing_drag,
    rate=bearing_rate,
    breakpoint=bearing_turn,
    signature=(
        "load cell reads less while the motor winds in than while it lets go, at the same voltage, "
        "by the same force at every speed and load; friction at the slide shows in the position"
    ),
    memory_scale=10.0,
    held=("presliding",),
    scanned=("presliding",),
)
