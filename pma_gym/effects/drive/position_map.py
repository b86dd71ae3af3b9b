"""Static map from motor voltage to displacement of the dissertation's linear model."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import interp, positive, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_TABLE_18 = "Serres 2008, table 18 (275 and 575 kPa: recovered from tables I13 and I20)"


class PositionMap(NamedTuple):
    """Rows of the map, one per pressure; pressures increase."""

    pressure: Annotated[tuple[float, ...], Quantity("kPa", 0, 1000, _TABLE_18)]
    square: Annotated[tuple[float, ...], Quantity("m/V^2", -0.1, 0.1, _TABLE_18)]
    linear: Annotated[tuple[float, ...], Quantity("m/V", -1, 1, _TABLE_18)]
    constant: Annotated[tuple[float, ...], Quantity("m", -0.1, 0.1, _TABLE_18)]


ONSET = 10.0
"""How much steeper than `linear` the map may rise from 0 V: our assumption. At 150 kPa, the only
row with a positive constant, it rises to the printed parabola within 10 mV."""


def mapped_displacement(motor_voltage, pressure, p):
    """Displacement at rest for a motor voltage, never below zero; 0 V gives 0.

        x_in = max(0, min(square V^2 + linear V + constant, 10 linear V))

    The coefficients are linear in pressure between rows and constant beyond them. Beyond its
    peak the parabola keeps the value of the peak, so that more voltage never gives less
    displacement.

    Args:
        motor_voltage: command V (V).
        pressure: gauge pressure (Pa).
        p: PositionMap.
    Returns:
        Displacement (m).
    Source:
        Serres 2008, table 18.
    """
    square = interp(pressure, p.pressure, p.square)
    linear = interp(pressure, p.pressure, p.linear)
    constant = interp(pressure, p.pressure, p.constant)
    # Only a parabola that opens downwards has a peak to be held at.
    peak = where(square < 0.0, linear / (-2.0 * where(square < 0.0, square, -1.0)), motor_voltage)
    voltage = motor_voltage - positive(motor_voltage - peak)
    parabola = (square * voltage + linear) * voltage + constant
    onset = ONSET * linear * voltage
    return positive(where(parabola < onset, parabola, onset))


POSITION_MAP = Effect("position_map", "position_map", PositionMap, mapped_displacement)
