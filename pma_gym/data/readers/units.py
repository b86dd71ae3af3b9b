"""Units as laboratories write them: `[mm]`, `(°)`, `kPa`, `Volts`."""

import re

from pma_gym.data.files.trial_hints import FACTORS
from pma_gym.data.trial_columns import Column

_NAMES = {
    "°": "deg",
    "º": "deg",
    "degree": "deg",
    "degrees": "deg",
    "grad": "deg",
    "µm": "um",
    "μm": "um",
    "µs": "us",
    "μs": "us",
    "seconds": "s",
    "second": "s",
    "millimeter": "mm",
    "millimetre": "mm",
    "newton": "N",
    "newtons": "N",
    "radians": "rad",
}
"""Other names of units, beside those that `FACTORS` knows."""

_KNOWN = {unit for factors in FACTORS.values() for unit in factors}
_ABSENT = {"-", "--", "1", "n/a"}
"""What stands in a row of units for none."""


def unit_of(text: str) -> str:
    """The unit that a text names, as `FACTORS` writes it; empty if it names none.

    Example:
        >>> unit_of("[mm]"), unit_of("(°)"), unit_of("Pressure")
        ('mm', 'deg', '')
    """
    if len(text) > 20:
        return ""
    bare = re.sub(r"[\[\](){}\s]", "", text)
    bare = _NAMES.get(bare, _NAMES.get(bare.lower(), bare)).lower()
    return bare if bare in _KNOWN else ""


def unit_factor(text: str, column: Column) -> float | None:
    """Factor that converts values of a unit to the column's.

    Args:
        text: the unit.
        column: whose unit is wanted.
    Returns:
        The factor; 1 for a text that names no unit at all; None for a unit of another quantity.
    """
    if text.strip() in _ABSENT or not unit_of(text):
        return 1.0
    # Pressure in MPa and mPa differ by their first letter alone; a log of a muscle means the first.
    return FACTORS[column.unit].get(unit_of(text))
