"""The spring of the three-element model: linear in contraction; pressure sets its stiffness."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_TABLE_2 = "Serres 2008, table 2"


class Stiffness(NamedTuple):
    """Parameters of `spring_stiffness`, one line below the breakpoint and one above."""

    low_intercept: Annotated[float, Quantity("N/mm", 0, 200, f"{_TABLE_2}: 32.7", 0.0, usual=32.7)]
    low_slope: Annotated[
        float, Quantity("N/mm/kPa", -1, 1, f"{_TABLE_2}: -0.0321", 0.0, usual=-0.0321)
    ]
    high_intercept: Annotated[float, Quantity("N/mm", 0, 200, f"{_TABLE_2}: 17.0", 0.0, usual=17.0)]
    high_slope: Annotated[
        float, Quantity("N/mm/kPa", -1, 1, f"{_TABLE_2}: 0.0179", 0.0, usual=0.0179)
    ]
    breakpoint: Annotated[float, Quantity("kPa", 0, 1000, f"{_TABLE_2}: 314", usual=314)]


def spring_stiffness(pressure, p):
    """Stiffness of the muscle at a pressure.

        K = low_intercept + low_slope P    up to the breakpoint
        K = high_intercept + high_slope P  above it

    Args:
        pressure: gauge pressure P (Pa).
        p: Stiffness: intercepts (N/m), slopes (N/m/Pa), breakpoint (Pa).
    Returns:
        Stiffness (N/m).
    Source:
        Serres 2008, table 2; a secant stiffness over the whole contraction, fitted at 150-550 kPa.
    """
    low = p.low_intercept + p.low_slope * pressure
    high = p.high_intercept + p.high_slope * pressure
    return where(pressure <= p.breakpoint, low, high)


def spring_force(pressure, contraction, p):
    """Force of the spring, -K x.

    Args:
        pressure: gauge pressure (Pa).
        contraction: shortening x from the resting length (m).
        p: Stiffness.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        Serres 2008, Eq. 8.
    """
    return -spring_stiffness(pressure, p) * contraction


STIFFNESS = Effect(
    name="stiffness",
    replaces="force law",
    port="muscle_force",
    parameters=Stiffness,
    held=("breakpoint",),
    law=spring_force,
    signature="force proportional to contraction, single-valued and independent of rate",
)
