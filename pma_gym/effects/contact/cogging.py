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


def cogging_force(contraction, p):
    """Conservative force that is periodic in the position.

        F = amplitude cos(2 pi periods x + phase)

    Args:
        contraction: position x (m).
        p: Cogging: amplitude (N), periods in a metre (1/m), phase (rad).
    Returns:
        Force (N); positive in the direction of contraction.
    Source:
        First harmonic of the cogging of magnets and teeth.
    """
    # The part of a period alone: `cosine` is a series that is right near zero.
    turns = p.periods * contraction
    part = turns - floor(turns + 0.5)
    return p.amplitude * cosine(6.283185307179586 * part + p.phase)


COGGING = Effect(
    name="cogging",
    port="contact_force",
    parameters=Cogging,
    law=cogging_force,
    signature="force periodic in the position, the same in both directions and at every speed",
)
