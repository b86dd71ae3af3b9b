"""A force that is periodic in position: cogging of magnets, ripple of a screw or a guide."""

from typing import Annotated, NamedTuple

from pma_gym.codegen.generic import floor
from pma_gym.effects.arithmetic import cosine
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Cogging(NamedTuple):
    """Parameters of `cogging_force`."""

    amplitude: Annotated[float, Quantity("N", 0, 1e6, "assumption: 1", 0.0, usual=1)]
    periods: Annotated[float, Quantity("1/m", 0.1, 2e4, "assumption: 100, one in 10 mm", usual=100)]
    phase: Annotated[float, Quantity("deg", -360, 360, "where the position's zero is", usual=0)]


class JointCogging(NamedTuple):
    """Parameters of `cogging_force` about an axis."""

    amplitude: Annotated[float, Quantity("N m", 0, 1e6, "assumption: 0.02", 0.0, usual=0.02)]
    periods: Annotated[float, Quantity("1/turn", 0.1, 2e4, "assumption: 24, as slots", usual=24)]
    phase: Annotated[float, Quantity("deg", -360, 360, "where the angle's zero is", usual=0)]


def cogging_force(position, p):
    """Conservative force that is periodic in the position.

        F = amplitude cos(2 pi periods x + phase)

    Args:
        position: x (m, rad), from the zero of its sensor.
        p: Cogging or JointCogging: amplitude (N, N m), periods (1/m, 1/rad), phase (rad).
    Returns:
        Force (N, N m); positive as the position grows.
    Source:
        First harmonic of the cogging of magnets and teeth.
    """
    # The part of a period alone: `cosine` is a series that is right near zero.
    turns = p.periods * position
    part = turns - floor(turns + 0.5)
    return p.amplitude * cosine(6.283185307179586 * part + p.phase)


_SIGNATURE = "force periodic in the position, the same in both directions and at every speed"

COGGING = Effect(
    name="cogging",
    port="contact_force",
    parameters=Cogging,
    law=cogging_force,
    signature=_SIGNATURE,
)
JOINT_COGGING = Effect(
    name="joint_cogging",
    port="joint_load",
    parameters=JointCogging,
    law=cogging_force,
    signature=_SIGNATURE,
)
