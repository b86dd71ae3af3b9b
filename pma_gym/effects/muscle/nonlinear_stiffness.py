"""Nonlinear part of the muscle's spring, as a function of contraction."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_FORM = "assumption: a tenth of the spring's force at 40 mm"


class NonlinearStiffness(NamedTuple):
    """Parameters of `stiffening_force`."""

    linear: Annotated[float, Quantity("1", -20, 20, f"{_FORM}, 0.5", 0.0, usual=0.5)]
    quadratic: Annotated[float, Quantity("1", -100, 100, f"{_FORM}, 1", 0.0, usual=1)]
    stiffness: Annotated[
        float, Quantity("N/mm", 1, 1000, "Serres 2008, table 2: 22-28, in round figures", usual=20)
    ]
    resting_length: Annotated[
        float, Quantity("mm", 10, 5000, "Serres 2008, 2.1.2.1: 250", usual=250)
    ]


def stiffening_force(contraction, p):
    """Force in addition to a linear spring; both together are -K x (1 + linear u + quadratic u^2).

        F = -K x (linear u + quadratic u^2),   u = x / L0

    Args:
        contraction: shortening x from the resting length (m).
        p: NonlinearStiffness: linear, quadratic, stiffness K (N/m), resting_length L0 (m).
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        Our form, a polynomial; `sarosi_force` has a steeper one that also depends on pressure.
    """
    share = contraction / p.resting_length
    return -p.stiffness * contraction * share * (p.linear + p.quadratic * share)


NONLINEAR_STIFFNESS = Effect(
    name="nonlinear_stiffness",
    port="muscle_force",
    parameters=NonlinearStiffness,
    law=stiffening_force,
    signature=(
        "force misfit that is curved in contraction, the same at every pressure, on every way "
        "there and at every rate"
    ),
    held=("stiffness", "resting_length"),
)
