"""Columns that a file calls otherwise: which of ours is meant, and in which unit it is."""

import difflib
import re
from collections.abc import Sequence

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_NAME, RAW_COLUMNS, Column, ColumnMap

FACTORS: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "V": {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3},
    "mm": {"mm": 1.0, "m": 1e3, "cm": 10.0, "um": 1e-3, "in": 25.4, "inch": 25.4},
    "N m": {"nm": 1.0, "mnm": 1e-3, "knm": 1e3},
    "rad/s": {"rad/s": 1.0, "deg/s": 0.01745329, "rpm": 0.1047198},
    "deg": {"deg": 1.0, "rad": 57.29578, "rev": 360.0, "turns": 360.0},
    "mm/s": {"mm/s": 1.0, "m/s": 1e3, "cm/s": 10.0, "in/s": 25.4},
    "N": {"n": 1.0, "kn": 1e3, "lbf": 4.448222, "kgf": 9.80665, "kp": 9.80665},
    "kPa": {"kpa": 1.0, "pa": 1e-3, "bar": 100.0, "mbar": 0.1, "mpa": 1e3, "psi": 6.894757},
}
"""By a column's unit: what a value in another unit is multiplied by."""

_STEMS = {
    "time_s": ("time", "t", "zeit"),
    **{signal.column: signal.stems for signal in SIGNALS.values() if signal.stems},
    **{column.name: (column.name.removesuffix("_v").replace("_", " "),) for column in RAW_COLUMNS},
}
_LONGEST = 80
"""Characters of a name that are looked at."""
_ALIKE = 0.8
"""Smallest similarity of two names that are taken for one."""


def looks_like(name: str) -> tuple[Column, float] | None:
    """The column that a strange name is likely to mean, and the factor that its unit asks for.

    >>> column, factor = looks_like("Pressure (bar)")
    >>> column.name, factor
    ('pressure_kpa', 100.0)
    """
    # Ratios of names take time that grows with their lengths.
    plain = name[:_LONGEST].replace("°", " deg").translate({0xB5: "u", 0x3BC: "u"})
    parts = re.findall(r"[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", " ", plain).lower())
    ends = {unit for factors in FACTORS.values() for unit in factors}
    unit = parts[-1] if len(parts) > 1 and parts[-1] in ends else ""
    stem = " ".join(parts[:-1] if unit else parts)
    close = [
        (difflib.SequenceMatcher(None, stem, known).ratio(), column)
        for column, stems in _STEMS.items()
        for known in stems
        if not unit or unit in FACTORS[BY_NAME[column].unit]
    ]
    likeness, nearest = max(close, default=(0.0, ""), key=lambda pair: pair[0])
    if likeness < _ALIKE:
        return None
    column = BY_NAME[nearest]
    return column, FACTORS[column.unit].get(unit, 1.0)


def strange_columns(header: Sequence[str], mapping: ColumnMap, trial: Trial) -> str:
    """Return a message on a file's unknown columns; empty if all are known.

    Args:
        header: names of the file's columns.
        mapping: the lab's names to ours.
        trial: what was read.
    """
    strange = [name for name in header if name and name not in BY_NAME and name not in mapping]
    if not strange:
        return ""
    known = {"time", *trial.commands, *trial.measurements}
    hints = []
    for name in strange:
        likely = looks_like(name)
        if likely and likely[0].quantity not in known:
            hints.append((name, *likely))
    said = f"unknown columns are ignored: {', '.join(map(repr, strange))}"
    if hints:
        meant = ", ".join(f"{name!r} looks like {column.name}" for name, column, _ in hints)
        lines = "; ".join(mapping_line(*hint) for hint in hints)
        said += f"; {meant}. If so, write under [columns] of dataset.toml: {lines}"
    return said


def mapping_line(name: str, column: Column, factor: float) -> str:
    """The line of `[columns]` that reads a file's column as ours.

    >>> mapping_line("p_bar", BY_NAME["pressure_kpa"], 100.0)
    '"p_bar" = { name = "pressure_kpa", factor = 100 }'
    """
    if factor == 1.0:
        return f'"{name}" = "{column.name}"'
    return f'"{name}" = {{ name = "{column.name}", factor = {factor:.7g} }}'
