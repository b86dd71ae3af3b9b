"""Pressure change by the muscle's volume, which can shrink faster than the regulator vents."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.effects.muscle.geometric_force import PI
from pma_gym.units import Quantity

ATMOSPHERE = 101325.0
"""Atmospheric pressure (Pa), the zero of gauge pressure."""

NARROWEST = 1e-4
"""Least width of the braid when pulled straight, as a share of the thread's length squared."""


class Filling(NamedTuple):
    """Parameters of `filling_rate`."""

    exponent: Annotated[
        float,
        Quantity(
            "1", 0, 1.67, "of a polytropic change: 1 isothermal, 1.4 adiabatic", 0.0, usual=1.2
        ),
    ]
    resting_length: Annotated[
        float, Quantity("mm", 100, 1000, "Serres 2008, 2.1.2.1: 250", usual=250)
    ]
    resting_diameter: Annotated[
        float, Quantity("mm", 1, 100, "Serres 2008, 2.1.2.1: 20 (inner)", usual=20)
    ]
    turns: Annotated[
        float,
        Quantity(
            "1", 0.1, 20, "as `schulte_force`, fitted to Serres 2008, table I3: 2.085", usual=2.085
        ),
    ]


def filling_rate(pressure, contraction, velocity, p):
    """Rate of pressure from the change of volume, in addition to the regulator's rate.

        P' = -exponent (P + P_atmosphere) V' / V,   V'/V = x' (3 L^2 - b^2) / (L (b^2 - L^2))

    V is that inside a braid of constant thread length,

        V = L (b^2 - L^2) / (4 pi n^2),   L = L0 - x,   b^2 = L0^2 + (pi n D0)^2

    It grows with contraction up to the angle of 54.7 deg. The volumes of the end caps and the
    hose, which reduce the rate, are neglected.

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        velocity: rate of contraction x' (m/s).
        p: Filling: exponent, resting_length L0 (m), resting_diameter D0 (m), turns n.
    Returns:
        Rate (Pa/s), positive while the muscle is pulled out.
    Source:
        1. Polytropic change of an ideal gas; textbook thermodynamics.
        2. The braid's geometry as in Serres 2008, Eq. 1 (C.-P. Chou and B. Hannaford 1996).
    """
    length = p.resting_length - contraction
    around = PI * p.turns * p.resting_diameter
    thread2 = p.resting_length * p.resting_length + around * around
    straight = NARROWEST * thread2
    across2 = straight + positive(thread2 - length * length - straight)
    growth = (3.0 * length * length - thread2) / (length * across2)
    return -p.exponent * (pressure + ATMOSPHERE) * growth * velocity


FILLING = Effect(
    name="filling",
    port="chamber",
    parameters=Filling,
    held=(
        "resting_length",
        "resting_diameter",
        "turns",
    ),
    law=filling_rate,
    signature="measured pressure rises when the motor pulls and falls when it lets go",
)
