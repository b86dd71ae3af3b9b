"""Dry friction of the slide, with true sticking (elasto-plastic bristle)."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import smoothstep, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

BREAKAWAY_SHARE = 0.7
"""Share of the sliding force below which the bristle is elastic: our assumption."""


class CoulombFriction(NamedTuple):
    """Parameters of `friction_force`."""

    static: Annotated[float, Quantity("N", 0, 200, "Serres 2008, 2.1.1.1: 1.96", 0.0)]
    dynamic: Annotated[float, Quantity("N", 0, 200, "Serres 2008, 2.1.1.1: 1.47", 0.0)]
    stribeck_speed: Annotated[
        float, Quantity("mm/s", 0.01, 1000, "assumption: 5 mm/s, ball slides 1-10")
    ]
    presliding: Annotated[
        float, Quantity("um", 0.1, 1000, "assumption: 10 um at full static force")
    ]


def friction_force(memory, p):
    """Force of the bristles on the slide.

        F = -z,  z in newton: deflection times bristle stiffness

    Args:
        memory: bristle force z (N).
        p: CoulombFriction: static, dynamic (N), stribeck_speed (m/s), presliding (m).
    Returns:
        Force (N); positive in the direction of contraction.
    Source:
        Serres 2008, section 2.1.1.1 gives 1.96 N static and 1.47 N dynamic. The state is that of
        Dupont et al. 2002 (elasto-plastic friction), which neither creeps nor drifts while stuck.
    """
    return -memory


def friction_rate(velocity, memory, p):
    """Rate of the bristle force.

        z' = k v - a(z, v) |v| k z / f(v),   k = static / presliding
        f(v) = dynamic + (static - dynamic) / (1 + (v / stribeck_speed)^2)

    a is 0 while |z| is under 0.7 f (purely elastic, so stuck) or the motion unloads the bristle,
    and 1 once |z| reaches f. A constant load under static holds for ever, and so does one that
    swings under 0.7 static; one that swings above it creeps a little at each swing. At static = 0
    there is no bristle and the law is absent.

    Args:
        velocity: rate of contraction v (m/s).
        memory: z (N).
        p: CoulombFriction.
    Returns:
        (source, decay) with z' = source - decay * z.
    """
    stiffness = p.static / p.presliding
    ratio = velocity / p.stribeck_speed
    level = p.dynamic + (p.static - p.dynamic) / (1.0 + ratio * ratio) + 1e-12
    elastic = BREAKAWAY_SHARE * level
    plastic = smoothstep((abs(memory) - elastic) / (level - elastic))
    plastic = where(velocity * memory > 0.0, plastic, 0.0)
    return stiffness * velocity, plastic * stiffness * abs(velocity) / level


COULOMB_FRICTION = Effect(
    name="coulomb_friction",
    port="slide_force",
    parameters=CoulombFriction,
    law=friction_force,
    rate=friction_rate,
    signature="odd step of force at zero speed; the slide sticks under small changes of load",
)
