"""Force of a fluidic muscle by Sarosi's six-number formula."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import exponential
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_FIT = "least-squares fit to Serres 2008, table I3, 200-575 kPa"


class SarosiForce(NamedTuple):
    """Parameters of `sarosi_force`, in the order of the source: a, b, -c, -d, e, f."""

    toe_slope: Annotated[
        float,
        Quantity("N/bar", -500, 500, f"{_FIT}: 6.15; not told from 0 (sd 5.6)", 0.0, usual=6.15),
    ]
    toe_force: Annotated[float, Quantity("N", -5000, 5000, f"{_FIT}: 299.7", 0.0, usual=299.7)]
    steepness: Annotated[float, Quantity("1/%", 0, 10, f"{_FIT}: 0.2955", usual=0.2955)]
    softening: Annotated[float, Quantity("N/bar/%", -500, 500, f"{_FIT}: 8.878", 0.0, usual=8.878)]
    slope: Annotated[float, Quantity("N/bar", -5000, 5000, f"{_FIT}: 277.1", 0.0, usual=277.1)]
    offset: Annotated[float, Quantity("N", -5000, 5000, f"{_FIT}: -267.3", 0.0, usual=-267.3)]
    resting_length: Annotated[
        float, Quantity("mm", 1, 5000, "Serres 2008, 2.1.2.1: 250", usual=250)
    ]


def sarosi_force(pressure, contraction, p):
    """Force of the muscle: linear in contraction and pressure, with a toe near the resting length.

        F = (toe_slope P + toe_force) exp(-steepness k) - softening P k + slope P + offset
        k = x / L0

    Departure: steepness and softening are positive here, the source's c and d are negative.
    `exponential` is exact to 1e-12 for |steepness k| up to 12, so for |k| up to 40 % at 0.2955.

    Args:
        pressure: gauge pressure P (Pa); the source has bar.
        contraction: shortening x from the resting length (m); the source has k in percent.
        p: SarosiForce: toe_slope (N/Pa), toe_force (N), steepness, softening (N/Pa), slope (N/Pa),
            offset (N), resting_length L0 (m).
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        1. J. Sarosi 2012, "New approximation algorithm for the force of fluidic muscles".
        2. Fitted to Serres 2008, table I3, 200-575 kPa: 12.8 N rms, 0.70 mm.
    """
    share = contraction / p.resting_length
    toe = (p.toe_slope * pressure + p.toe_force) * exponential(-p.steepness * share)
    return toe - p.softening * pressure * share + p.slope * pressure + p.offset


SAROSI_FORCE = Effect(
    name="sarosi_force",
    replaces="force law",
    port="muscle_force",
    parameters=SarosiForce,
    held=("resting_length",),
    law=sarosi_force,
    signature="force stiffens towards the resting length; single-valued, independent of rate",
)
