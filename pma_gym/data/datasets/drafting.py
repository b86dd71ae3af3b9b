"""A first `dataset.toml` for a lab's files, to be read and corrected.

Guesses of a lab's columns from their names, units and values.
"""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset_files import list_files, read_files
from pma_gym.data.datasets.dataset_toml import Description
from pma_gym.data.files.trial_hints import FACTORS, looks_like
from pma_gym.data.readers.clock import clock_seconds
from pma_gym.data.readers.layout import unit_of
from pma_gym.data.readers.table import Table, cell_number, decimal_mark
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


@dataclass(frozen=True)
class SeenColumn:
    """A column as the files have it.

    Attributes:
        name: its name there.
        unit: what a row of units says; empty if none does.
        low, high: least and largest number in all files; NaN where there is none.
        files: how many files have it.
        guess: what it is likely to be; None where nothing speaks for anything.
        chosen: whether the draft takes it for that: of several columns that are alike, the first.
    """

    name: str
    unit: str
    low: float
    high: float
    files: int
    guess: Guess | None
    chosen: bool


def seen_columns(
    folder: Path, description: Description, quantities: Collection[str]
) -> tuple[list[SeenColumn], int]:
    """The columns of a folder's files, in the order of the first file that has them.

    Args:
        folder: the data set.
        description: what an older `dataset.toml` says; only its form counts.
        quantities: what the rig commands and measures.
    Returns:
        The columns, and how many tables were read.
    Raises:
        TrialError: no file can be read.
    """
    files, _ = list_files(folder)
    tables = [table for _, table in read_files(folder, files, description)[0]]
    numbers: dict[str, list[NDArray[np.float64]]] = {}
    units: dict[str, str] = {}
    for table in tables:
        for index, name in enumerate(table.header):
            if name:
                numbers.setdefault(name, []).append(_numbers(table, index))
                units.setdefault(name, table.units.get(index, ""))
    columns, taken = [], set()
    for name, parts in numbers.items():
        values = np.concatenate(parts)
        there = values[np.isfinite(values)]
        guess = guess_column(name, units[name], there, quantities)
        chosen = guess is not None and guess.column.quantity not in taken
        if guess is not None:
            taken.add(guess.column.quantity)
        low, high = (float(there.min()), float(there.max())) if there.size else (np.nan, np.nan)
        columns.append(SeenColumn(name, units[name], low, high, len(parts), guess, chosen))
    return columns, len(tables)


def draft(title: str, model: str, columns: Sequence[SeenColumn], proposals: Sequence[str]) -> str:
    """The text of a `dataset.toml`.

    Args:
        title: of the data set.
        model: what to compare it with.
        columns: what the files have.
        proposals: what checks of the data say, for comments.
    """
    lines = [
        "# A draft: read it, correct it. ours = factor * theirs + offset, in the unit of our name.",
        f"title = {quoted(title)}",
        f"model = {quoted(model)}",
        "",
        "[columns]",
    ]
    for each in columns:
        seen = f"{each.low:.6g} to {each.high:.6g}"
        if each.guess is None or not each.chosen:
            why = (
                "no known column"
                if each.guess is None
                else (f"also looks like {each.guess.column.name}")
            )
            lines.append(f"# {quoted(each.name)} is left out: {why} ({seen})")
            continue
        column, factor = each.guess.column, each.guess.factor
        if each.name == column.name and factor == 1.0:
            lines.append(f"# {quoted(each.name)} is a known name ({seen})")
            continue
        entry = f'"{column.name}"'
        if factor != 1.0:
            entry = f"{{ name = {entry}, factor = {factor:.7g} }}"
        lines.append(f"{quoted(each.name)} = {entry}  # {seen}; {one_line(each.guess.why)}")
    if proposals:
        lines += ["", "# What the checks say of this draft:"]
        lines += [f"# - {one_line(proposal)}" for proposal in proposals]
    return "\n".join(lines) + "\n"


def quoted(text: str) -> str:
    """A text in TOML: names of files and columns may hold anything."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    shown = (c if c.isprintable() else f"\\U{ord(c):08X}" for c in escaped)
    return '"' + "".join(shown) + '"'


def one_line(text: str) -> str:
    """A text that ends no comment early."""
    return re.sub(r"\s+", " ", "".join(c if c.isprintable() else " " for c in text)).strip()


def _numbers(table: Table, index: int) -> NDArray[np.float64]:
    cells = table.cells[index]
    seconds = clock_seconds(cells)
    if seconds is not None:
        return np.asarray(seconds, float)
    mark = decimal_mark([cells])
    numbers = [cell_number(cell, mark) for cell in cells]
    return np.array([np.nan if number is None else number for number in numbers], float)
