"""Colbrunn's muscle: a spring, a viscous damper and dry friction in parallel.

This file holds the spring. The damper is `damping` with contracting = relaxing = high_intercept
and high_slope = 0; the friction of tube on braid is `coulomb_friction`. A model with these three
effects has Colbrunn's muscle.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_FIT = "least-squares fit to Serres 2008, table I3, 200-575 kPa"


class ColbrunnSpring(NamedTuple):
    """Parameters of `colbrunn_spring`."""

    stiffness: Annotated[float, Quantity("N/mm", 0, 1000, f"{_FIT}: 13.19", 0.0, usual=13.19)]
    stiffening: Annotated[
        float, Quantity("N/mm/kPa", -1, 1, f"{_FIT}: 0.00072", 0.0, usual=0.00072)
    ]
    hardening_length: Annotated[float, Quantity("mm", 1, 1e6, f"{_FIT}: 88.03", usual=88.03)]
    reach: Annotated[float, Quantity("mm", 0, 5000, f"{_FIT}: 157.2", usual=157.2)]
    half_pressure: Annotated[float, Quantity("kPa", 1, 1e5, f"{_FIT}: 684.5", usual=684.5)]


def colbrunn_spring(pressure, contraction, p):
    """Force of a hardening spring whose free length shortens with pressure.

        F = (stiffness + stiffening P) s (1 + (s / hardening_length)^2)
        s = reach P / (P + half_pressure) - x

    s is the extension beyond the length at which the muscle exerts no force.

    Departure: Serres 2008 describes the three elements but prints no formula, and we had no access
    to the source's polynomial. This form is ours; it has the described property, a nonlinear
    force-length relation that pressure drives.

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        p: ColbrunnSpring: stiffness (N/m), stiffening (N/m/Pa), hardening_length (m), reach (m),
            half_pressure (Pa).
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        1. R. W. Colbrunn, G. M. Nelson and R. D. Quinn 2001, "Modeling of braided pneumatic
           actuators for robotic control"; Serres 2008, 1.2.2.3.
        2. Fitted to Serres 2008, table I3, 200-575 kPa: 36.6 N rms, 1.92 mm.
    """
    stretch = p.reach * pressure / (pressure + p.half_pressure) - contraction
    share = stretch / p.hardening_length
    return (p.stiffness + p.stiffening * pressure) * stretch * (1.0 + share * share)


COLBRUNN_SPRING = Effect(
    name="colbrunn_spring",
    replaces="force law",
    port="muscle_force",
    parameters=ColbrunnSpring,
    held=("hardening_length", "reach", "half_pressure"),
    law=colbrunn_spring,
    signature="one force against stretch beyond the free length, moved along by pressure",
)
