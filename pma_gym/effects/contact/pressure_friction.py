"""Dry friction that grows with pressure: a seal that the pressure pushes onto the rod."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.effects.slide.coulomb_friction import friction_path, release_path
from pma_gym.units import Quantity


class PressureFriction(NamedTuple):
    """Parameters of `pressure_friction`."""

    slope: Annotated[
        float,
        Quantity("N/kPa", 0, 1000, "assumption: 1 N/bar, a lip seal of 25 mm", 0.0, usual=0.01),
    ]
    presliding: Annotated[
        float, Quantity("um", 0.1, 20000, "assumption: 10 um at full force", usual=10)
    ]


def pressure_friction(pressure, memory, p):
    """Force of the bristles, in proportion to the pressure on them.

        F = -slope max(0, P) z

    Args:
        pressure: gauge pressure P (Pa).
        memory: deflection z of the bristles, between -1 and 1; see `friction_path`.
        p: PressureFriction: slope (N/Pa), presliding (m).
    Returns:
        Force (N); positive in the direction of contraction.
    Source:
        Coulomb's law for a lip that the pressure presses on; what it has without pressure is
        `coulomb_friction`.
    """
    return -p.slope * positive(pressure) * memory


PRESSURE_FRICTION = Effect(
    name="pressure_friction",
    port="contact_force",
    parameters=PressureFriction,
    law=pressure_friction,
    rate_independent_law=friction_path,
    release_path=release_path,
    held=("presliding",),
    signature="odd step of force where the motion turns, in proportion to the pressure",
)
