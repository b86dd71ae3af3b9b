"""Dry friction of the slide, with true sticking (elasto-plastic bristle)."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import clip, positive, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

BREAKAWAY_SHARE = 0.7
"""Share of the sliding force below which the bristle is elastic: our assumption."""


STRIBECK_SPEEDS = 3.0
"""Speed, in Stribeck speeds, at which a step ends: a larger step would miss the short drop of the
force."""


class CoulombFriction(NamedTuple):
    """Parameters of `friction_force`."""

    static: Annotated[float, Quantity("N", 0, 1e5, "Serres 2008, 2.1.1.1: 1.96", 0.0, usual=1.96)]
    dynamic: Annotated[float, Quantity("N", 0, 1e5, "Serres 2008, 2.1.1.1: 1.47", 0.0, usual=1.47)]
    stribeck_speed: Annotated[
        float, Quantity("mm/s", 0.01, 1000, "assumption: 5 mm/s, ball slides 1-10", usual=5)
    ]
    presliding: Annotated[
        float, Quantity("um", 0.0001, 1000, "assumption: 10 um at full static force", usual=10)
    ]


def friction_force(velocity, friction_factor, memory, p):
    """Force of the bristles on the slide.

        F = -k f(v) z,   f(v) = dynamic + (static - dynamic) / (1 + (v / stribeck_speed)^2)

    Args:
        velocity: rate of contraction v (m/s).
        friction_factor: factor k on its level, from the place on the stroke; else 1.
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
    level = p.dynamic + (p.static - p.dynamic) / (1.0 + ratio * ratio)
    return -level * friction_factor * memory


def friction_path(memory, travel, direction, p):
    """Deflection of the bristles after a travel of the slide without a reversal.

    Below 0.7 of the full deflection the bristles are elastic and the slide sticks: z changes by
    travel / presliding, on the same line in both directions. Above, the bristles begin to slip: z
    is a parabola of the travel and reaches 1 after 1.3 presliding distances, at every speed. A
    constant load below static holds for ever, and so does an oscillating load below 0.7 static. A
    larger oscillating load makes the slide creep a little in each period.

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
    from_start = where(
        start > BREAKAWAY_SHARE, BREAKAWAY_SHARE + 2.0 * slipping * (1.0 - rest**0.5), start
    )
    reached = from_start + direction * travel / p.presliding
    slip = clip((reached - BREAKAWAY_SHARE) * (1.0 / slipping), 0.0, 2.0)
    # A step that goes on beyond where it turns is refused, but what it says of there shall be sane.
    elastic = clip(reached, -1.5, BREAKAWAY_SHARE)
    return direction * (elastic + slipping * slip * (1.0 - 0.25 * slip))


def friction_breakpoint(memory, direction, p):
    """Distance to the point where bristles begin to slip, or, from there, where all of them slip.

    Args:
        memory: z where the travel begins.
        direction: 1 where the slide moves in the direction of contraction, else -1.
        p: CoulombFriction.
    Returns:
        Distance (m), 0 where all bristles slip or there is no friction.
    """
    return where(p.static + p.dynamic > 0.0, p.presliding, 0.0) * elastic_way(memory, direction)


def elastic_way(memory, direction):
    """Distance to where bristles begin to slip, or from there to full slip, in presliding lengths.

    Args:
        memory: z where the travel begins.
        direction: 1 where the motion is forwards, else -1.
    """
    start, slipping = direction * memory, 1.0 - BREAKAWAY_SHARE
    rest = positive(1.0 - start) * (1.0 / slipping)
    return where(start < BREAKAWAY_SHARE, BREAKAWAY_SHARE - start, 2.0 * slipping * rest**0.5)


def release_path(memory, direction, p):
    """Distance after a reversal until the bristles are relaxed; they return elastically.

    Args:
        memory: deflection z where the travel begins.
        direction: 1 where the motion is in the direction of contraction, else -1.
        p: parameters with presliding (m).
    Returns:
        Distance (m); 0 where the motion deflects them further.
    """
    return p.presliding * positive(-direction * memory)


def stribeck_breakpoint(velocity, p):
    """Speed in excess of the speed at which the Stribeck effect has dropped by nine tenths.

    Args:
        velocity: rate of contraction (m/s).
        p: CoulombFriction.
    Returns:
        Speed (m/s), negative where the force still falls with speed; 1 where it does not fall.
    """
    above = abs(velocity) - STRIBECK_SPEEDS * p.stribeck_speed
    falls = where(p.static > p.dynamic, 1.0, 0.0)
    return falls * above + (1.0 - falls)


COULOMB_FRICTION = Effect(
    name="coulomb_friction",
    port="slide_force",
    parameters=CoulombFriction,
    held=("presliding",),
    scanned=("presliding",),
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
