"""A table as it stands in a file, and the lab's description of the form of its files.

Cells to numbers: signs, decimal marks, grouped thousands, words for "not measured".
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial_columns import BY_NAME, ColumnMap, TrialError
from pma_gym.units import parse_number

Cells = Sequence[object] | NDArray[np.float64]
"""Cells of one column: numbers, texts, dates; None, NaN or "" where a cell is empty."""

PROVENANCE = "provenance"
"""Name of the XLSX sheet and, after `pma_gym.`, of the Parquet metadata."""

PART = "#"
"""Between a file's name and the part of it that is meant: `march.xlsx#run2`."""


_MOST_RANGES = 12


def ranges(columns: Iterable[Iterable[float | None]]) -> str:
    """What columns without names hold.

    >>> ranges([[0.0, 0.5], [None, -1.0]])
    'column 1 holds 0 to 0.5, column 2 holds -1 to -1'
    """
    said = []
    for number, column in enumerate(islice(columns, _MOST_RANGES), start=1):
        values = np.array([np.nan if value is None else value for value in column], float)
        there = values[np.isfinite(values)]
        content = f"{there.min():.4g} to {there.max():.4g}" if there.size else "no number"
        said.append(f"column {number} holds {content}")
    return ", ".join(said)


class UnreadableError(TrialError):
    """A file that holds no table at all: damaged, of another kind, or its library is missing."""


def damaged(file: str, happened: str) -> UnreadableError:
    """What to say of a file that its library cannot read."""
    return UnreadableError(
        f"{file} cannot be read: damaged or not what its name says ({happened}); write it again, "
        "or save the trial as CSV"
    )


class NoHeaderError(TrialError):
    """A table that begins with its samples, so that nothing names its columns."""


@dataclass(frozen=True)
class FileFormat:
    """What `[format]` of a `dataset.toml` says where a file's form has two readings.

    Attributes:
        separator: between the cells of a text file; None: the one that fits.
        decimal: "." or ","; None: the one that fits.
        encoding: of a text file; None: the one that fits.
        header_row: number of the row with the columns' names; None: the one that fits.
        names: names of the columns, where the files have no row with them; empty if they have one.
        missing: numbers that stand for "not measured", in the file's units.
        interpolation: of commands over empty cells: "zoh" (held) or "foh" (joined linearly); None:
            held.
    """

    separator: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    header_row: int | None = None
    names: tuple[str, ...] = ()
    missing: tuple[float, ...] = ()
    interpolation: str | None = None


@dataclass(frozen=True)
class Request:
    """What a reader may rely on to recognise a table.

    Attributes:
        columns: the lab's names of columns to ours.
        format: the lab's description of its files.
    """

    columns: ColumnMap = field(default_factory=dict)
    format: FileFormat = field(default_factory=FileFormat)

    def is_known(self, name: object) -> bool:
        """Test whether a header's name is one of ours, or the lab's for one of ours."""
        return isinstance(name, str) and (name in BY_NAME or name in self.columns)

    def is_time(self, name: object) -> bool:
        """Test whether a header's name is that of the time."""
        return self.kind(name) == "time"

    def kind(self, name: object) -> str:
        """What a column is by its name: "time", "command", "measurement"; empty if not known."""
        entry = self.columns.get(name, name) if isinstance(name, str) else None
        ours = entry.get("name", name) if isinstance(entry, Mapping) else entry
        column = BY_NAME.get(ours) if isinstance(ours, str) else None
        return column.kind if column else ""


@dataclass(frozen=True)
class Table:
    """Cells of a file as they stand there.

    Attributes:
        file: the file's name, for messages; with the part's where a file holds several.
        header: names of the columns.
        cells: one sequence a column.
        rows: number of each row in the file, as an editor or a spreadsheet counts.
        provenance: metadata beside the table.
        part: name of the sheet, segment, group or structure; empty where a file has one table.
        units: unit of a column by its position, from a row or a property of the file.
        remarks: what was passed over or converted, for warnings.
    """

    file: str
    header: Sequence[str]
    cells: Sequence[Cells]
    rows: Sequence[int]
    provenance: Mapping[str, str] = field(default_factory=dict)
    part: str = ""
    units: Mapping[int, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def place(self, index: int) -> str:
        """Where the sample of an index stands."""
        return f"row {self.rows[index]} of {self.file}"


def shown(cell: object, most: int = 60) -> str:
    """A cell for a message, cut to a readable length."""
    text = repr(cell)
    return text if len(text) <= most else f"{text[: most - 4]}...'"


NOT_MEASURED = ("", "nan", "na")
"""Texts, in any case, of a cell in which nothing was measured; they can mean nothing else."""

_BLANKS = "'\u2019\u00a0\u2009\u202f "
"""Marks between groups of three digits that are neither point nor comma."""
_SPACED = re.compile(rf"[+-]?[0-9]{{1,3}}(?:[{_BLANKS}][0-9]{{3}})+(?:[.,][0-9]+)?")
_GROUPS = {
    mark: re.compile(rf"[+-]?[1-9][0-9]{{0,2}}(?:\{other}[0-9]{{3}})+(?:\{mark}[0-9]+)?")
    for mark, other in ((".", ","), (",", "."))
}
"""By decimal mark: a number whose thousands are grouped by the other mark."""
_DECIMAL = {
    mark: re.compile(rf"[+-]?(?:[0-9]+\{mark}[0-9]*|\{mark}[0-9]+)(?:[eE][+-]?[0-9]+)?")
    for mark in ".,"
}
_LONGEST = 100
"""Characters of the longest cell that is looked at for marks."""
_MINUS = str.maketrans(dict.fromkeys("\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d", "-"))
"""Signs that a locale or a word processor writes for a minus."""


def bare_text(cell: str) -> str:
    """The text of a cell without blanks around it, every minus as ASCII's."""
    bare = cell.strip()
    return bare if bare.isascii() else bare.translate(_MINUS)


def decimal_mark(columns: Iterable[Cells]) -> str:
    """The decimal mark of a file's numbers, by all of its cells.

    A comma is one where some cell can be read in no other way (`0,5`, `25,3`) and no cell needs a
    point; else it is the point.

    Args:
        columns: cells of the columns that hold numbers.
    Returns:
        "." or ",".
    """
    comma = False
    for cells in columns:
        for cell in cells:
            if not isinstance(cell, str) or len(cell) > _LONGEST:
                continue
            bare = bare_text(cell)
            if "." in bare and _DECIMAL["."].fullmatch(bare) and not _GROUPS[","].fullmatch(bare):
                return "."
            if "," in bare and "." in bare and _GROUPS["."].fullmatch(bare):
                return "."
            if "," in bare and not _GROUPS["."].fullmatch(bare):
                comma = comma or bool(_DECIMAL[","].fullmatch(bare) or _GROUPS[","].fullmatch(bare))
    return "," if comma else "."


def has_groups(cells: Cells, mark: str, stated: bool = False) -> bool:
    """Test whether a column's numbers have grouped thousands.

    Args:
        cells: of the column.
        mark: the file's decimal mark.
        stated: whether the lab states it: then the other mark can only group.
    Returns:
        True where one cell shows both marks, or two groups: `3,785.9` and `1,234,567` can be read
        in one way; `3,785` alone in two.
    """
    other = "," if mark == "." else "."
    for cell in cells:
        if isinstance(cell, str) and other in cell and len(cell) <= _LONGEST:
            bare = bare_text(cell)
            sure = stated or mark in bare or bare.count(other) > 1
            if sure and _GROUPS[mark].fullmatch(bare):
                return True
    return False


def cell_number(cell: object, mark: str = ".", grouped: bool = False) -> float | None:
    """The number in a cell.

    Args:
        cell: number, text or None.
        mark: decimal mark of the file.
        grouped: whether the column groups thousands by the other mark.
    Returns:
        The number; NaN where nothing was measured; None for anything else.

    Example:
        >>> cell_number("25,3", ","), cell_number("3,785.9", ".", True), cell_number("1_000")
        (25.3, 3785.9, None)
    """
    if not isinstance(cell, str):
        return _object_number(cell)
    bare = bare_text(cell)
    plain = parse_number(bare)
    if plain is not None and (mark == "." or "." not in cell):
        return plain
    if bare.lower() in NOT_MEASURED:
        return math.nan
    return None if len(bare) > _LONGEST else _marked(bare, mark, grouped)


def _marked(bare: str, mark: str, grouped: bool) -> float | None:
    """The number in a text with decimal commas or grouped thousands."""
    if _SPACED.fullmatch(bare):
        bare = re.sub(f"[{_BLANKS}]", "", bare)
    other = "," if mark == "." else "."
    if other in bare:
        both = mark in bare or bare.count(other) > 1
        if not (_GROUPS[mark].fullmatch(bare) and (grouped or both)):
            return None
        bare = bare.replace(other, "")
    return parse_number(bare.replace(",", "."))


def _object_number(cell: object) -> float | None:
    """The number in a cell that is no text."""
    if cell is None:
        return math.nan
    if isinstance(cell, bool) or not isinstance(cell, int | float):
        return None
    try:
        return float(cell)
    except OverflowError:
        return None


def looks_ambiguous(cell: object) -> bool:
    """Whether a cell's comma or point may be a decimal mark or group thousands: `3,785`."""
    bare = bare_text(cell) if isinstance(cell, str) and len(cell) <= _LONGEST else ""
    return any(groups.fullmatch(bare) is not None for groups in _GROUPS.values())
