"""Force of a pressure on the piston of a cylinder."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class PistonForce(NamedTuple):
    """Parameters of `piston_force`."""

    area: Annotated[
        float, Quantity("mm^2", 0, 1e6, "assumption: 491, a bore of 25 mm", 0.0, usual=491)
    ]


def piston_force(pressure, p):
    """Force of a pressure on the piston's area.

        F = area P

    Args:
        pressure: gauge pressure P (Pa).
        p: PistonForce: area (m^2), less the rod's area where the rod passes through.
    Returns:
        Force (N); positive in the direction of contraction, in which the pressure pushes.
    Source:
        Hydrostatics.
    """
    return p.area * pressure


PISTON_FORCE = Effect(
    name="piston_force",
    port="rod_force",
    parameters=PistonForce,
    law=piston_force,
    signature="force in proportion to the pressure, the same at every position and speed",
)
