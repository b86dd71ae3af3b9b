"""How a muscle turns a joint: over a pulley, or at a lever."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import cosine
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_QUARTER = 1.5707963267948966
_AT_ZERO = Quantity(
    "mm", -1000, 1000, "assumption: 20, in the middle of a muscle's stroke", usual=20
)


class Pulley(NamedTuple):
    """Parameters of `pulley`."""

    radius: Annotated[float, Quantity("mm", 1, 1000, "Serres 2008, table I3: 25.4", usual=25.4)]
    contraction_at_zero: Annotated[float, _AT_ZERO]


class Lever(NamedTuple):
    """Parameters of `lever`."""

    arm: Annotated[float, Quantity("mm", 1, 1000, "assumption: 30", usual=30)]
    base: Annotated[
        float, Quantity("mm", 1, 5000, "assumption: 250, about a muscle's length", usual=250)
    ]
    angle_at_zero: Annotated[
        float, Quantity("deg", 1, 179, "90: the arm is across the base", usual=90)
    ]
    contraction_at_zero: Annotated[float, _AT_ZERO]


def pulley(angle, p):
    """Contraction and moment arm of a muscle whose cable lies on a pulley.

        x = contraction_at_zero + radius q,   moment arm = radius

    Args:
        angle: of the joint q (rad); it grows as this muscle shortens.
        p: Pulley: radius (m), contraction_at_zero (m).
    Returns:
        (contraction, moment arm) (m); the arm is the rate of contraction with the angle.
    Source:
        Geometry of a cable on a circle.
    """
    return p.contraction_at_zero + p.radius * angle, p.radius


def lever(angle, p):
    """Contraction and moment arm of a muscle between a fixed point and a lever.

        l(phi)^2 = a^2 + b^2 - 2 a b cos(phi),   phi = angle_at_zero - q
        x = contraction_at_zero + l(angle_at_zero) - l(phi),   moment arm = a b sin(phi) / l(phi)

    Args:
        angle: of the joint q (rad); it grows as this muscle shortens.
        p: Lever: arm a (m) from the axis to the muscle's end, base b (m) from the axis to its fixed
            end, angle_at_zero (rad) between both at q = 0, contraction_at_zero (m).
    Returns:
        (contraction, moment arm) (m); the arm is the rate of contraction with the angle.
    Source:
        Law of cosines.
    """
    squares, twice = p.arm * p.arm + p.base * p.base, 2.0 * p.arm * p.base
    between = p.angle_at_zero - angle
    length = (squares - twice * cosine(between)) ** 0.5
    at_zero = (squares - twice * cosine(p.angle_at_zero)) ** 0.5
    arm = 0.5 * twice * cosine(between - _QUARTER) / length
    return p.contraction_at_zero + at_zero - length, arm


PULLEY = Effect(
    name="pulley",
    port="moment_arm",
    parameters=Pulley,
    law=pulley,
    held=("radius", "contraction_at_zero"),
    signature="contraction in proportion to the angle",
)
LEVER = Effect(
    name="lever",
    port="moment_arm",
    parameters=Lever,
    law=lever,
    held=("arm", "base", "angle_at_zero", "contraction_at_zero"),
    signature="a torque that changes with the angle at a constant force",
)
