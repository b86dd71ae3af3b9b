"""Viscous damping of the muscle: by direction of motion, or equal in both directions."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_TABLE_2 = "Serres 2008, table 2"


class Damping(NamedTuple):
    """Parameters of `damping`."""

    contracting: Annotated[float, Quantity("N s/mm", 0, 20, f"{_TABLE_2}: 2.90", 0.0, usual=2.9)]
    relaxing: Annotated[float, Quantity("N s/mm", 0, 20, f"{_TABLE_2}: 1.57", 0.0, usual=1.57)]
    high_intercept: Annotated[
        float, Quantity("N s/mm", -20, 20, f"{_TABLE_2}: 0.311", 0.0, usual=0.311)
    ]
    high_slope: Annotated[
        float, Quantity("N s/mm/kPa", -0.1, 0.1, f"{_TABLE_2}: 0.00338", 0.0, usual=0.00338)
    ]
    breakpoint: Annotated[float, Quantity("kPa", 0, 1000, f"{_TABLE_2}: 372", usual=372)]


def damping(pressure, velocity, p):
    """Damping coefficient B; the force is -B x'.

        B = contracting                         x' > 0
        B = relaxing                            x' < 0, up to the breakpoint
        B = high_intercept + high_slope P       x' < 0, above it

    The force is continuous at x' = 0 although B is not.

    Args:
        pressure: gauge pressure P (Pa).
        velocity: rate of contraction x' (m/s), positive when the muscle shortens.
        p: Damping: coefficients (N s/m), slope (N s/m/Pa), breakpoint (Pa).
    Returns:
        Coefficient (N s/m), not negative.
    Source:
        Serres 2008, table 2. The fit assumes that the pressure steps instantly, so the printed
        values contain part of the regulator's lag.
    """
    high = p.high_intercept + p.high_slope * pressure
    relaxing = where(pressure <= p.breakpoint, p.relaxing, high)
    return where(velocity > 0.0, p.contracting, relaxing)


DAMPING = Effect(
    name="damping",
    replaces="damping law",
    port="muscle_damping",
    parameters=Damping,
    held=("breakpoint",),
    law=damping,
    signature="force proportional to speed, another factor in each direction",
)


class SymmetricDamping(NamedTuple):
    """Parameters of `symmetric_damping`."""

    intercept: Annotated[
        float,
        Quantity("N s/mm", -1e5, 1e5, "fitted to Serres 2008, tables I2 and I3", 0.0, usual=0.25),
    ]
    slope: Annotated[
        float,
        Quantity(
            "N s/mm/kPa", -1e3, 1e3, "fitted to Serres 2008, tables I2 and I3", 0.0, usual=0.0015
        ),
    ]


def symmetric_damping(pressure, p):
    """Damping coefficient B, the same in both directions; the force is -B x'.

        B = max(0, intercept + slope P)

    Args:
        pressure: gauge pressure P (Pa).
        p: SymmetricDamping: intercept (N s/m), slope (N s/m/Pa).
    Returns:
        Coefficient (N s/m), not negative.
    Source:
        Ours: with a regulator that fills and vents at different rates, the pressure steps of Serres
        2008, table I2, need no damping that depends on direction.
    """
    return positive(p.intercept + p.slope * pressure)


SYMMETRIC_DAMPING = Effect(
    name="symmetric_damping",
    replaces="damping law",
    port="muscle_damping",
    parameters=SymmetricDamping,
    law=symmetric_damping,
    signature="force proportional to speed, the same both ways",
)
