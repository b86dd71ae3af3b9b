"""Dry friction of the slide, with true sticking (elasto-plastic bristle)."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import clip, positive, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

BREAKAWAY_SHARE = 0.7
"""Share of the sliding force below which the bristle is elastic: our assumption."""


STRIBECK_SPEEDS = 3.0
"""Speed, in Stribeck speeds, at which a step ends: the force's fall is too short to be seen from
beyond."""


class CoulombFriction(NamedTuple):
    """Parameters of `friction_force`."""

    static: Annotated[float, Quantity("N", 0, 1e5, "Serres 2008, 2.1.1.1: 1.96", 0.0, usual=1.96)]
    dynamic: Annotated[float, Quantity("N", 0, 1e5, "Serres 2008, 2.1.1.1: 1.47", 0.0, usual=1.47)]
    stribeck_speed: Annotated[
        float, Quantity("mm/s", 0.01, 1000, "assumption: 5 mm/s, ball slides 1-10", usual=5)
    ]
    presliding: Annotated[
        float, Quantity("um", 0.1, 1000, "assumption: 10 um at full static force", usual=10)
    ]


def friction_force(velocity, memory, p):
    """Force of the bristles on the slide.

        F = -f(v) z,   f(v) = dynamic + (static - dynamic) / (1 + (v / stribeck_speed)^2)

    Args:
        velocity: rate of contraction v (m/s).
        memory: deflection z of the bristles, between -1 and 1.
        p: CoulombFriction: static, dynamic (N), stribeck_speed (m/s), presliding (m).
    Returns:
        Force (N); positive in the direction of contraction.
    Source:
        Serres 2008, section 2.1.1.1 gives 1.96 N static and 1.47 N dynamic. The state is that of
        Dupont et al. 2002 (elasto-plastic friction), which neither creeps nor drifts while stuck;
        the fall of the force with speed (Stribeck) multiplies it.
    """
    ratio = velocity / p.stribeck_speed
    return -(p.dynamic + (p.static - p.dynamic) / (1.0 + ratio * ratio)) * memory


def friction_path(memory, travel, direction, p):
    """Deflection of the bristles after the slide has travelled on without turning.

    Under 0.7 of the full deflection the bristles are elastic, so the slide is stuck: z grows by
    travel / presliding, forwards and back on the same line. Above, they begin to slip: z bends over
    as a parabola of the travel and reaches 1 after 1.3 presliding distances, whatever the speed. A
    constant load under static holds for ever, and so does one that swings under 0.7 static; one
    that swings above it creeps a little at each swing.

    Args:
        memory: z where the travel began.
        travel: displacement since then (m), in the direction of contraction.
        direction: 1 where the slide moves in the direction of contraction, else -1.
        p: CoulombFriction.
    Returns:
        z after it.
    """
    start, slipping = direction * memory, 1.0 - BREAKAWAY_SHARE
    rest = positive(1.0 - start) * (1.0 / slipping)
    begun = where(
        start > BREAKAWAY_SHARE, BREAKAWAY_SHARE + 2.0 * slipping * (1.0 - rest**0.5), start
    )
    reached = begun + direction * travel / p.presliding
    slip = clip((reached - BREAKAWAY_SHARE) * (1.0 / slipping), 0.0, 2.0)
    # A step that goes on beyond where it turns is refused, but what it says of there shall be sane.
    elastic = clip(reached, -1.5, BREAKAWAY_SHARE)
    return direction * (elastic + slipping * slip * (1.0 - 0.25 * slip))


def friction_breakpoint(memory, direction, p):
    """Way to where the deflection begins to bend over, or, from there, to where all bristles slip.

    Args:
        memory: z where the travel begins.
        direction: 1 where the slide moves in the direction of contraction, else -1.
        p: CoulombFriction.
    Returns:
        Way (m), 0 where all slip or nothing rubs.
    """
    return where(p.static + p.dynamic > 0.0, p.presliding, 0.0) * elastic_way(memory, direction)


def elastic_way(memory, direction):
    """Way, in preslidings, to where the deflection bends over or, from there, to where all slip.

    Args:
        memory: z where the travel begins.
        direction: 1 where the motion is forwards, else -1.
    """
    start, slipping = direction * memory, 1.0 - BREAKAWAY_SHARE
    rest = positive(1.0 - start) * (1.0 / slipping)
    return where(start < BREAKAWAY_SHARE, BREAKAWAY_SHARE - start, 2.0 * slipping * rest**0.5)


def release_path(memory, direction, p):
    """Way that a turn takes until the bristles are relaxed: they are elastic on their way back.

    Args:
        memory: deflection z where the travel begins.
        direction: 1 where the motion is in the direction of contraction, else -1.
        p: parameters with presliding (m).
    Returns:
        Way (m); 0 where the motion deflects them further.
    """
    return p.presliding * positive(-direction * memory)


def stribeck_breakpoint(velocity, p):
    """Speed beyond that at which nine tenths of what static exceeds dynamic are gone.

    Args:
        velocity: rate of contraction (m/s).
        p: CoulombFriction.
    Returns:
        Speed (m/s), negative while the force still falls; 1 where it does not fall.
    """
    above = abs(velocity) - STRIBECK_SPEEDS * p.stribeck_speed
    falls = where(p.static > p.dynamic, 1.0, 0.0)
    return falls * above + (1.0 - falls)


COULOMB_FRICTION = Effect(
    name="coulomb_friction",
    port="slide_force",
    parameters=CoulombFriction,
    held=("presliding",),
    ties=(("static", "dynamic", "stribeck_speed"),),
    law=friction_force,
    rate_independent_law=friction_path,
    path_breakpoint=friction_breakpoint,
    breakpoint=stribeck_breakpoint,
    signature=(
        "odd step of force at zero speed, the same at every load and pressure; the slide sticks "
        "under small changes of load. Stribeck: static over dynamic, the step is higher within "
        "stribeck_speed of rest, so slow motion comes in jerks"
    ),
)
