"""Units and signs of measured signals, by the given model's simulation of the same commands.

A signal in another unit is the simulated one times a known factor. A wrong model is not: friction
or a delay bends the course, a spring too stiff shrinks contraction and rotation together. So a
factor counts only if the course stays the simulated one's, and if either the level is changed by
the same factor or another signal of the same motion is not changed at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.discovery.preparation.data_checks.simulated import ATMOSPHERE, Pair
from pma_gym.discovery.thresholds import (
    AS_GIVEN,
    CORRELATED,
    NEAR_LEVEL,
    NEAR_UNIT,
    PRESSURE_FAR,
    PRESSURE_NEAR,
    WEATHER_PA,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Unit:
    """What a column may be in.

    Attributes:
        factor: measured = factor * what it should be, + offset.
        words: the unit's name.
        offset: see factor (SI).
        command: whether the command's column is in another unit, not the measurement's.
    """

    factor: float
    words: str
    offset: float = 0.0
    command: bool = False

    def corrected(self, value: Array) -> Array:
        """What a reading in the unit should be (SI)."""
        return (value - self.offset) / self.factor


MOTION_UNITS = {
    "contraction": (
        Unit(-1.0, "the opposite sign"),
        Unit(0.1, "centimetres"),
        Unit(-0.1, "centimetres of the opposite sign"),
        Unit(1e-3, "metres"),
        Unit(-1e-3, "metres of the opposite sign"),
        Unit(1e3, "micrometres"),
        Unit(-1e3, "micrometres of the opposite sign"),
        Unit(1.0 / 25.4, "inches"),
        Unit(-1.0 / 25.4, "inches of the opposite sign"),
        Unit(1e3 / 25.4, "thousandths of an inch"),
        Unit(10.0, "tenths of a millimetre"),
    ),
    "rotation": (
        Unit(-1.0, "the opposite sign"),
        Unit(np.pi / 180.0, "radians"),
        Unit(-np.pi / 180.0, "radians of the opposite sign"),
        Unit(1.0 / 360.0, "turns"),
        Unit(-1.0 / 360.0, "turns of the opposite sign"),
        Unit(1e3 * np.pi / 180.0, "milliradians"),
        Unit(60.0, "minutes of arc"),
    ),
    "load": (
        Unit(-1.0, "the opposite sign"),
        Unit(1e-3, "kilonewtons"),
        Unit(-1e-3, "kilonewtons of the opposite sign"),
        Unit(1.0 / 9.80665, "kilograms-force"),
        Unit(-1.0 / 9.80665, "kilograms-force of the opposite sign"),
        Unit(1.0 / 4.448222, "pounds-force"),
        Unit(-1.0 / 4.448222, "pounds-force of the opposite sign"),
        Unit(1e3 / 9.80665, "grams-force"),
        Unit(1e3, "millinewtons"),
    ),
}
"""By measurement whose zero is free."""

COMMAND_UNITS = {
    "load": (
        Unit(1e3, "kilonewtons", command=True),
        Unit(9.80665, "kilograms-force", command=True),
        Unit(4.448222, "pounds-force", command=True),
    )
}
"""Where the measurement is the factor times what the model makes of the command."""

_SCALES = (
    (1.0, "kilopascals"),
    (0.01, "bar"),
    (10.0, "millibars"),
    (1.0 / 6.894757, "psi"),
    (1e-3, "megapascals"),
    (1e3, "pascals"),
    (7.500617, "millimetres of mercury"),
)

ABSOLUTE = Unit(1.0, "absolute pressure", ATMOSPHERE)

PRESSURE_UNITS = (
    *(Unit(factor, words) for factor, words in _SCALES[1:]),
    *(Unit(f, f"absolute pressure in {words}", f * ATMOSPHERE) for f, words in _SCALES[1:]),
    ABSOLUTE,
    Unit(-1.0, "the opposite sign"),
)

PRESSURE_COMMAND_UNITS = (
    *(Unit(1.0 / factor, words, command=True) for factor, words in _SCALES[1:]),
    Unit(1.0, "absolute pressure", -ATMOSPHERE, command=True),
)

LEAST_READINGS = 8
"""Fewest readings that tell a slope."""

MOST_LAG_S, LAGS = 0.3, 61
"""How late a signal may be for its slope; how many lags are tried."""


@dataclass(frozen=True)
class Slope:
    """A signal of a trial beside its simulation.

    Attributes:
        slope: of measured on simulated, at the lag where they are most alike.
        alike: their correlation there.
        level: measured over simulated, of their medians where the simulated one is large enough,
            else NaN.
    """

    slope: float
    alike: float
    level: float


def slope_of(pair: Pair, quantity: str) -> Slope | None:
    """Robust slope of a measured signal on the simulated one; None where it hardly moves."""
    time, simulated, measured = pair.signal(quantity)
    least = SIGNALS[quantity].least_span
    if time.size < LEAST_READINGS or np.ptp(simulated) <= least or np.ptp(measured) == 0.0:
        return None
    best = max(_correlations(time, simulated, measured), key=lambda each: abs(each[0]) + each[2])
    alike, lag, _ = best
    late = np.interp(time - lag, time, simulated)
    level = float(np.median(simulated))
    large = abs(level) > SIGNALS[quantity].least_span
    return Slope(
        _robust_slope(late, measured),
        alike,
        float(np.median(measured)) / level if large else np.nan,
    )


def _correlations(
    time: Array, simulated: Array, measured: Array
) -> list[tuple[float, float, float]]:
    """Correlation, lag and what speaks for the lag: none at all is preferred, and no sign."""
    correlations = []
    for lag in np.linspace(0.0, MOST_LAG_S, LAGS):
        late = np.interp(time - lag, time, simulated)
        if np.ptp(late) == 0.0:
            continue
        value = float(np.corrcoef(late, measured)[0, 1])
        # A signal that is late by half a period of a sine looks like the opposite sign.
        correlations.append((value, float(lag), 0.05 * (value > 0.0) - 1e-3 * lag))
    return correlations


def _robust_slope(simulated: Array, measured: Array) -> float:
    """Slope by least squares that large residuals pull no harder at than usual ones (Huber)."""
    columns = np.stack([simulated, np.ones(simulated.size)], axis=1)
    weights = np.ones(simulated.size)
    slope = 0.0
    for _ in range(8):
        root = np.sqrt(weights)
        (slope, offset), *_ = np.linalg.lstsq(columns * root[:, None], measured * root, rcond=None)
        away = np.abs(measured - slope * simulated - offset)
        usual = 1.5 * 1.4826 * float(np.median(away)) or 1.0
        weights = usual / np.maximum(away, usual)
    return float(slope)


def motion_unit(quantity: str, pair: Pair) -> Unit | None:
    """The unit in which contraction, rotation or load seems to be; None for the right one.

    Args:
        quantity: contraction, rotation or load.
        pair: a trial beside its simulation.
    """
    seen = slope_of(pair, quantity)
    if seen is None or abs(seen.alike) < CORRELATED or AS_GIVEN[0] <= seen.slope <= AS_GIVEN[1]:
        return None
    units = MOTION_UNITS[quantity]
    if _asks_for(pair, "load_command"):
        units += COMMAND_UNITS.get(quantity, ())
    fitting = [unit for unit in units if _distance(seen.slope, unit.factor) < NEAR_UNIT[quantity]]
    if not fitting:
        return None
    unit = min(fitting, key=lambda each: _distance(seen.slope, each.factor))
    return unit if _is_borne_out(quantity, pair, seen, unit) else None


def _asks_for(pair: Pair, command: str) -> bool:
    """Whether a trial gives a command in its own unit, not as a voltage."""
    commands = pair.trial.commands
    return command in commands and SIGNALS[command].voltage not in commands


def _distance(slope: float, factor: float) -> float:
    if slope * factor <= 0.0:
        return np.inf
    return abs(float(np.log(slope / factor)))


_WITNESS = {"contraction": "rotation", "rotation": "contraction"}


def _is_borne_out(quantity: str, pair: Pair, seen: Slope, unit: Unit) -> bool:
    """Whether something beside the slope speaks for a unit."""
    if unit.factor == -1.0 or SIGNALS[quantity].is_force:
        # No physics turns a motion round; a drive's load follows its command.
        return True
    if abs(seen.level / unit.factor - 1.0) < NEAR_LEVEL:
        return True
    other = _WITNESS[quantity]
    witness = slope_of(pair, other)
    return (
        witness is not None
        and abs(witness.alike) >= CORRELATED
        and AS_GIVEN[0] <= abs(witness.slope) <= AS_GIVEN[1]
    )


def pressure_unit(pairs: Sequence[Pair]) -> Unit | None:
    """The unit in which measured pressures of some trials, or their commands, seem to be.

    Args:
        pairs: trials beside their simulations; all that measure pressure count.
    """
    simulated, measured = _levels(pairs)
    if not simulated.size or np.max(simulated) < SIGNALS["pressure"].least_span:
        return None
    if _off(simulated, measured, Unit(1.0, "")) < PRESSURE_FAR:
        return None
    volts = SIGNALS["pressure_command"].voltage
    commanded = not any(volts in pair.trial.commands for pair in pairs)
    units = [*PRESSURE_UNITS, *(PRESSURE_COMMAND_UNITS if commanded else ())]
    best = min(units, key=lambda unit: _off(simulated, measured, unit))
    return best if _off(simulated, measured, best) < PRESSURE_NEAR else None


def _levels(pairs: Sequence[Pair]) -> tuple[Array, Array]:
    """Pressures of many instants of the trials, simulated and measured (Pa)."""
    levels: list[tuple[Array, Array]] = []
    for pair in pairs:
        _, simulated, measured = pair.signal("pressure")
        chosen = slice(None, None, max(1, simulated.size // 200))
        levels.append((simulated[chosen], measured[chosen]))
    if not levels:
        return np.empty(0), np.empty(0)
    return np.concatenate([s for s, _ in levels]), np.concatenate([m for _, m in levels])


def _off(simulated: Array, measured: Array, unit: Unit) -> float:
    """Median share by which measured pressures miss what a unit makes of simulated ones."""
    expected = unit.factor * simulated + unit.offset
    scale = abs(unit.factor) * max(float(np.median(simulated)), SIGNALS["pressure"].least_span)
    away = np.median(np.abs(measured - expected)) / scale
    if unit.offset:
        # The air of a high town weighs less: its share is not held against the unit.
        shift = float(np.median(measured - expected))
        allowed = abs(unit.factor) * WEATHER_PA
        if -allowed < np.sign(unit.offset) * shift < allowed / 4.0:
            away = np.median(np.abs(measured - expected - shift)) / scale
    return float(away)
