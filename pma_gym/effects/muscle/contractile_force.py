"""Force of the muscle at its resting length, linear in pressure."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class ContractileForce(NamedTuple):
    """Parameters of `contractile_force`."""

    slope: Annotated[
        float,
        Quantity(
            "N/kPa",
            0,
            20,
            "Serres 2008, section 5.1.1: 2.91; geometric 2.46 in 6.1",
            0.0,
            usual=2.91,
        ),
    ]
    intercept: Annotated[
        float, Quantity("N", -500, 500, "Serres 2008, section 5.1.1: 44.6", 0.0, usual=44.6)
    ]


def contractile_force(pressure, p):
    """Force of the muscle at its resting length.

        F_ce = slope * P + intercept

    Args:
        pressure: gauge pressure P (Pa).
        p: ContractileForce: slope (N/Pa), intercept (N).
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        Serres 2008, section 5.1.1; fitted on 186-1262 N, extrapolated above 429 kPa, where it
        is 10-15 % above the manufacturer's curve in the dissertation's comparison (19 % above
            the 1500 N rated at 600 kPa).
    """
    return p.slope * pressure + p.intercept


CONTRACTILE_FORCE = Effect(
    name="contractile_force",
    replaces="force law",
    port="muscle_force",
    parameters=ContractileForce,
    law=contractile_force,
    signature="offset of force that grows with pressure, the same at every length",
)
