"""Dry friction of a contact that a drive moves, constant or proportional to pressure.

Both are terms of one bristle law: the bristles deflect elastically after a reversal and slip at a
force that does not depend on speed, but that it may rise near rest (Stribeck). An imposed motion
shows the deflection in its data; a free slide does not.
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
    rise: Annotated[
        float, Quantity("N", 0, 1e6, "assumption: 1, a fifth of the force", 0.0, usual=1)
    ] = 0.0
    stribeck_speed: Annotated[
        float, Quantity("mm/s", 1e-4, 1e4, "assumption: 5 mm/s, as of a slide", usual=5)
    ] = 5e-3


class PressureFriction(NamedTuple):
    """Parameters of `pressure_friction`."""

    slope: Annotated[
        float,
        Quantity("N/kPa", 0, 1000, "assumption: 1 N/bar, a lip seal of 25 mm", 0.0, usual=0.01),
    ]
    presliding: Annotated[float, _PRESLIDING]


def contact_friction(velocity, memory, p):
    """Friction force of the bristles.

        F = -(force + rise / (1 + (v / stribeck_speed)^2)) z

    Args:
        velocity: rate of contraction v (m/s).
        memory: deflection z of the bristles, between -1 and 1; see `friction_path`.
        p: ContactFriction: force (N), presliding (m), rise of the force at rest (N),
            stribeck_speed (m/s).
    Returns:
        Force (N); positive in the direction of contraction.
    Source:
        Coulomb's law, with the bristles and the fall with speed of `coulomb_friction`.
    """
    ratio = velocity / p.stribeck_speed
    return -(p.force + p.rise / (1.0 + ratio * ratio)) * memory


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
    terms=(("rise", "stribeck_speed"),),
    law=contact_friction,
    rate_independent_law=friction_path,
    release_path=release_path,
    signature=(
        "odd step of force where the motion turns, the same at every pressure and speed; it may "
        "rise within stribeck_speed of rest"
    ),
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
