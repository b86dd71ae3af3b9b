"""A first `dataset.toml` for a lab's files, to be read and corrected."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset_files import list_files, read_files
from pma_gym.data.datasets.dataset_toml import Description
from pma_gym.data.files.column_guess import Guess, guess_column
from pma_gym.data.readers.cells import cell_number, decimal_mark
from pma_gym.data.readers.clock import clock_seconds
from pma_gym.data.readers.table import Table


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
