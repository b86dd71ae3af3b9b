"""A table as it stands in a file, and the lab's description of the form of its files."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial_columns import BY_NAME, ColumnMap, TrialError

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
