"""Guesses of a lab's columns from their names, units and values."""

import re
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.files.trial_hints import FACTORS, looks_like
from pma_gym.data.readers.layout import unit_of
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial_columns import BY_NAME, RAW_COLUMNS, Column

Array = NDArray[np.float64]

_SAID = [signal for signal in SIGNALS.values() if signal.words]

_WORDS: dict[str, tuple[str, ...]] = {
    "time": ("time", "zeit", "t", "timestamp", "elapsed"),
    **{s.name: s.words for s in _SAID if s.is_pressure},
    **{s.name: s.words for s in _SAID if s.kind == "measurement"},
    **{s.name: s.words for s in _SAID},
}
"""Words of a name, in English and German, by quantity: pressures first, commands last."""

_ASKED = ("soll", "set", "setpoint", "sp", "command", "cmd", "ref", "reference", "target", "demand")
"""Words of a name that make a pressure or a load a command."""

_MEASURED = {"time": "time_s"} | {s.name: s.column for s in _SAID}
_COMMANDED = {s.measured: s.column for s in SIGNALS.values() if s.measured}
_RAW = {column.quantity: column.name for column in RAW_COLUMNS}


@dataclass(frozen=True)
class Guess:
    """The likely content of a column.

    Attributes:
        column: ours.
        factor: by which its values are to be multiplied.
        why: what speaks for it.
    """

    column: Column
    factor: float
    why: str


def guess_column(name: str, unit: str, values: Array, quantities: Collection[str]) -> Guess | None:
    """Guess what a column holds; None without evidence.

    Args:
        name: its name in the file.
        unit: its unit, where the file tells it beside the name; else empty.
        values: its numbers, NaN where a cell holds none.
        quantities: what the rig commands and measures.
    """
    if name in BY_NAME:
        return Guess(BY_NAME[name], 1.0, "its name")
    stem, suffix_unit = _split(name)
    unit = unit_of(unit) or suffix_unit
    parts = re.findall(r"[^\W\d_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", stem).lower())
    for quantity, known in _WORDS.items():
        if not any(word in known for word in parts) or quantity not in {"time", *quantities}:
            continue
        if unit == "v" and quantity in _RAW and not set(parts) & set(_ASKED):
            return Guess(BY_NAME[_RAW[quantity]], 1.0, "its name, in volts")
        asked = quantity in _COMMANDED and bool(set(parts) & set(_ASKED))
        column = BY_NAME[(_COMMANDED if asked else _MEASURED)[quantity]]
        factor = FACTORS.get(column.unit, {}).get(unit) if unit else None
        if unit and factor is None:
            continue
        if factor is not None:
            return Guess(column, factor, f"its name and unit, {unit}")
        return Guess(column, *_by_range(column, values))
    close = looks_like(name)
    if close is None or close[0].quantity not in {"time", *quantities}:
        return None
    return Guess(*close, "a name like it")


def _split(name: str) -> tuple[str, str]:
    """A name without its unit, and the unit: `Druck [bar]`, `Weg_mm`, `p (kPa)`."""
    bracketed = re.search(r"[\[(]([^\])]*)[\])]", name)
    if bracketed and unit_of(bracketed[1].split(" ")[0]):
        return name[: bracketed.start()], unit_of(bracketed[1].split(" ")[0])
    stem, mark, last = name.rpartition("_") if "_" in name else name.rpartition(" ")
    return (stem, unit_of(last)) if mark and unit_of(last) else (name, "")


def _by_range(column: Column, values: Array) -> tuple[float, str]:
    """Factor and reason of a column without a unit, by what its values reach."""
    there = np.abs(values[np.isfinite(values)])
    reached = float(np.quantile(there, 0.98)) if there.size else 0.0
    for unit, low, high in _RANGES.get(column.unit, ()):
        if low < reached <= high:
            factor = FACTORS[column.unit][unit]
            return factor, f"its name; values up to {reached:.3g} look like {unit}"
    return 1.0, f"its name; taken for {column.unit}"


_RANGES: dict[str, tuple[tuple[str, float, float], ...]] = {
    "kPa": (("bar", 0.5, 12.0), ("kpa", 12.0, 1.5e3), ("mbar", 1.5e3, 2e4), ("pa", 2e4, 2e6)),
    "mm": (("m", 1e-3, 0.3), ("mm", 1.0, 300.0), ("um", 300.0, 3e5)),
    "N": (("kn", 1e-2, 2.0), ("n", 20.0, 5e3)),
}
"""By a column's unit: units, and the values that a muscle reaches in them."""
