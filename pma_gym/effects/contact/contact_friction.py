"""Dry friction of a contact that a drive moves, constant or proportional to pressure.

Both are terms of one bristle law: the bristles deflect elastically after a reversal and slip at a
force that does not depend on speed. An imposed motion shows the deflection in its data; a free
slide does not.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.effects.slide.coulomb_friction import friction_path, release_path
from pma_gym.units import Quantity

_PRESLIDING = Quantity("um", 0.1, 20000, "assumption: 100 um at full force", usual=100)


class ContactFriction(NamedTuple):
    """Parameters of `contact_friction`."""

    force: Annotated[float, Quantity("N", 0, 1e6, "assumption: 5", 0.0, usual=5)]
    presliding: Annotated[float, _PRESLIDING]


class PressureFriction(NamedTuple):
    """Parameters of `pressure_friction`."""

    slope: Annotated[
        float,
        Quantity("N/kPa", 0, 1000, "assumption: 1 N/bar, a lip seal of 25 mm", 0.0, usual=0.01),
    ]
    presliding: Annotated[float, _PRESLIDING]


def contact_friction(memory, p):
    """Friction force of the bristles.

        F = -force z

    Args:
        memory: deflection z of the bristles, between -1 and 1; see `friction_path`.
        p: ContactFriction: force (N), presliding (m).
    Returns:
        Force (N); positive in the direction of contraction.
    Source:
        Coulomb's law, with the bristles of `coulomb_friction`.
    """
    return -p.force * memory


def pressure_friction(pressure, memory, p):
    """Friction force of the bristles, proportional to the pressure on them.

        F = -slope max(0, P) z

    Args:
        pressure: gauge pressure P (Pa).
        memory: deflection z of the bristles, between -1 and 1; see `friction_path`.
        p: PressureFriction: slope (N/Pa), presliding (m).
    Returns:
        Force (N); positive in the direction of contraction.
    Source:
        Coulomb's law for a seal lip that the pressure presses on; its friction without pressure is
        `contact_friction`.
    """
    return -p.slope * positive(pressure) * memory


CONTACT_FRICTION = Effect(
    name="contact_friction",
    port="rod_force",
    parameters=ContactFriction,
    law=contact_friction,
    rate_independent_law=friction_path,
    release_path=release_path,
    signature="odd step of force where the motion turns, the same at every speed and pressure",
)
PRESSURE_FRICTION = Effect(
    name="pressure_friction",
    port="rod_force",
    parameters=PressureFriction,
    law=pressure_friction,
    rate_independent_law=friction_path,
    release_path=release_path,
    signature="odd step of force where the motion turns, in proportion to the pressure",
)
