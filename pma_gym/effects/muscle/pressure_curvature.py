"""Corrections of a force law linear in pressure: a passive spring, and curvature in pressure."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_FIT = "fitted to Serres 2008, table I3, beside `sarosi_force`"


class PressureCurvature(NamedTuple):
    """Parameters of `pressure_curvature`."""

    passive: Annotated[float, Quantity("N/%", -500, 500, _FIT, 0.0, usual=8.7)]
    softening: Annotated[float, Quantity("N/bar^2/%", -100, 100, _FIT, 0.0, usual=-0.23)]
    offset: Annotated[float, Quantity("N/bar^2", -500, 500, _FIT, 0.0, usual=-11.9)]
    resting_length: Annotated[
        float, Quantity("mm", 1, 5000, "Serres 2008, 2.1.2.1: 250", usual=250)
    ]


def pressure_curvature(pressure, contraction, p):
    """Force in addition to a law that is linear in pressure.

        F = -passive k - softening P^2 k + offset P^2,   k = x / L0

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        p: PressureCurvature: passive (N), softening (N/Pa^2), offset (N/Pa^2), resting_length L0
            (m).
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        Ours: the terms that table I3 of Serres 2008 supports when each pressure in turn is left
        out of the fit of Sarosi's form (`sarosi_force`).
    """
    share = contraction / p.resting_length
    square = pressure * pressure
    return (p.offset - p.softening * share) * square - p.passive * share


PRESSURE_CURVATURE = Effect(
    name="pressure_curvature",
    port="muscle_force",
    parameters=PressureCurvature,
    held=("resting_length",),
    law=pressure_curvature,
    signature="force misfit that is parabolic in pressure, the same at every rate",
)
