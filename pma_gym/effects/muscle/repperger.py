"""Repperger's muscle: a spring that depends on position and a damper that depends on velocity.

Both act in parallel with `contractile_force`. They generalise the elements of the three-element
model.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_FIT = "least-squares fit to Serres 2008, table I3, 200-575 kPa"
_STEPS = "least-squares fit to Serres 2008, table I2"
_REYNOLDS = "Reynolds et al. 2003 (another muscle, 207-621 kPa)"


class ReppergerSpring(NamedTuple):
    """Parameters of `repperger_spring`."""

    stiffness: Annotated[
        float, Quantity("N/mm", -200, 200, f"{_FIT}: 25.01; {_REYNOLDS}: 5.71", 0.0, usual=25.01)
    ]
    stiffening: Annotated[
        float,
        Quantity("N/mm/kPa", -1, 1, f"{_FIT}: 0.03403; {_REYNOLDS}: 0.0307", 0.0, usual=0.03403),
    ]
    linear: Annotated[float, Quantity("N/mm^2", -50, 50, f"{_FIT}: -0.6378", 0.0, usual=-0.6378)]
    quadratic: Annotated[float, Quantity("N/mm^3", -1, 1, f"{_FIT}: 0.005308", 0.0, usual=0.005308)]


def repperger_spring(pressure, contraction, p):
    """Force of a spring whose stiffness is a polynomial in position.

        F = -K x,   K = stiffness + linear x + quadratic x^2 + stiffening P

    Departure: Serres 2008 states that K is a function of position but prints no formula, and we had
    no access to the source; the second degree is our choice. The source's K does not depend on
    pressure (stiffening = 0); that term comes from its successor [2].

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        p: ReppergerSpring: stiffness (N/m), stiffening (N/m/Pa), linear (N/m^2),
            quadratic (N/m^3).
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        1. D. W. Repperger, K. R. Johnson and C. A. Phillips 1998; Serres 2008, 1.2.2.3.
        2. D. B. Reynolds and others 2003, "Modeling the dynamic characteristics of pneumatic
           muscle".
        3. Fitted to Serres 2008, table I3, 200-575 kPa, together with a contractile force of
           2.739 N/kPa and 44.9 N: 20.5 N rms, 0.95 mm. Without stiffening 42.3 N.
    """
    rise = p.linear * contraction + p.quadratic * contraction * contraction
    return -(p.stiffness + p.stiffening * pressure + rise) * contraction


class ReppergerDamping(NamedTuple):
    """Parameters of `repperger_damping`."""

    viscous: Annotated[
        float,
        Quantity("N s/mm", 0, 20, f"{_STEPS}: 1.79; {_REYNOLDS}: 1.01 and 0.6", 0.0, usual=1.79),
    ]
    stiffening: Annotated[
        float,
        Quantity(
            "N s/mm/kPa",
            -0.1,
            0.1,
            f"{_STEPS}: 0.0016; {_REYNOLDS}: 0.00691, 0.000803",
            0.0,
            usual=0.0016,
        ),
    ]
    speed_slope: Annotated[
        float,
        Quantity(
            "N s^2/mm^2", -1, 1, f"{_STEPS}, at half the first speed: 0.0020", 0.0, usual=0.002
        ),
    ]


def repperger_damping(pressure, velocity, p):
    """Damping coefficient that depends on velocity; the force is -B x'.

        B = max(0, viscous + stiffening P + speed_slope x')

    The velocity has its sign, so that a contracting muscle is damped more than a relaxing one, as
    filling differs from venting.

    Departure: Serres 2008 states that B is a function of velocity but prints no formula, and we had
    no access to the source. The straight line is our choice; Serres 2008, table I2, supports no
    further term. The dependence on pressure comes from [2].

    Args:
        pressure: gauge pressure P (Pa).
        velocity: rate of contraction x' (m/s), positive when the muscle shortens.
        p: ReppergerDamping: viscous (N s/m), stiffening (N s/m/Pa), speed_slope (N s^2/m^2).
    Returns:
        Coefficient (N s/m), not negative.
    Source:
        1. D. W. Repperger, K. R. Johnson and C. A. Phillips 1998; Serres 2008, 1.2.2.3.
        2. D. B. Reynolds and others 2003.
        3. Fitted to both damping columns of Serres 2008, table I2: 0.69 N s/mm rms. The speeds
           were not measured; we assume half of K x / B at the start of each step.
    """
    return positive(p.viscous + p.stiffening * pressure + p.speed_slope * velocity)


REPPERGER_SPRING = Effect(
    name="repperger_spring",
    replaces="force law",
    port="muscle_force",
    parameters=ReppergerSpring,
    law=repperger_spring,
    signature="stiffness changes with position; single-valued and independent of rate",
)
REPPERGER_DAMPING = Effect(
    name="repperger_damping",
    replaces="damping law",
    port="muscle_damping",
    parameters=ReppergerDamping,
    law=repperger_damping,
    signature="force not proportional to speed, and another one in each direction",
)
