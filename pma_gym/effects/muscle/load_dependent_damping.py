"""Damping that depends on the muscle's load relative to its greatest force."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import clip, positive, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

ROUNDING = 0.1
"""Half-width of the range of loads in which their share levels off at 1: our choice."""

_PEAK = "Serres 2008, table I2 at 250 kPa, 1.3 to 5.2 N s/mm at middle load"


class LoadDependentDamping(NamedTuple):
    """Parameters of `load_factor`."""

    linear: Annotated[float, Quantity("1", -20, 20, f"{_PEAK}: 12", 0.0, usual=12)]
    quadratic: Annotated[float, Quantity("1", -20, 20, f"{_PEAK}: -12", 0.0, usual=-12)]
    force_slope: Annotated[
        float, Quantity("N/kPa", 0, 20, "Serres 2008, section 5.1.1: 2.91", usual=2.91)
    ]
    force_intercept: Annotated[
        float, Quantity("N", 1, 500, "Serres 2008, section 5.1.1: 44.6", usual=44.6)
    ]


def load_factor(pressure, cable_tension, p):
    """Factor on the damping coefficient.

        B = B_plain max(0, 1 + linear u + quadratic u^2),   u = T / F_ce, at most 1
        F_ce = force_slope P + force_intercept

    From 0.9 to 1.1, u levels off at 1 as a parabola: a whipping cable passes this range fast, and
    a kink would cost accuracy.

    Args:
        pressure: gauge pressure P (Pa).
        cable_tension: load T of the muscle (N).
        p: LoadDependentDamping: linear, quadratic, force_slope (N/Pa), force_intercept (N).
    Returns:
        Factor, not negative.
    Source:
        Our parabola; in Serres 2008, table I2, damping peaks at medium load.
    """
    share = cable_tension / (p.force_slope * pressure + p.force_intercept)
    over = clip((share - (1.0 - ROUNDING)) * (0.5 / ROUNDING), 0.0, 1.0)
    share = clip(share, 0.0, 1.0 + ROUNDING) - ROUNDING * over * over
    return positive(1.0 + share * (p.linear + p.quadratic * share))


def load_breakpoint(pressure, cable_tension, p):
    """Distance of the load's share from the range in which it levels off at 1.

    Args:
        pressure: gauge pressure (Pa).
        cable_tension: load of the muscle (N).
        p: LoadDependentDamping.
    Returns:
        Share, negative within that range; 1 where the effect is absent.
    """
    away = abs(cable_tension / (p.force_slope * pressure + p.force_intercept) - 1.0) - ROUNDING
    there = where(abs(p.linear) + abs(p.quadratic) > 0.0, 1.0, 0.0)
    return there * away + (1.0 - there)


LOAD_DEPENDENT_DAMPING = Effect(
    name="load_dependent_damping",
    port="damping_factor",
    parameters=LoadDependentDamping,
    held=(
        "force_slope",
        "force_intercept",
    ),
    law=load_factor,
    breakpoint=load_breakpoint,
    signature="force proportional to speed, by a factor that depends on the load",
)
