"""A trial's table from its file: which reader, which part, which rows."""

import os
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from pma_gym.data.files.trial_formats import DECODERS
from pma_gym.data.readers.table import (
    PART,
    Cells,
    FileFormat,
    Request,
    Table,
    UnreadableError,
    cell_number,
    decimal_mark,
)
from pma_gym.data.trial_columns import ColumnMap, TrialError, suggestion
from pma_gym.files import as_path
from pma_gym.limits import LimitError, check_limit

_NEEDED = "a trial needs a header with time_s and a command, and a row for each sample"
_SHOWN = 5


def known_suffix(path: Path, known: Collection[str] = DECODERS) -> str:
    """The suffix in lower case.

    Raises:
        TrialError: it is not among the known ones.
    """
    suffix = path.suffix.lower()
    if suffix not in known:
        raise TrialError(
            f"{path.name} must end in {', '.join(known)}, got {path.suffix or 'no suffix'!r}; "
            "save it in one of these formats"
        )
    return suffix


def split_part(path: str | os.PathLike[str]) -> tuple[Path, str]:
    """A file, and the part of it that a name like `march.xlsx#run2` means; "" for all of it."""
    whole = as_path(path, TrialError)
    name, mark, part = os.fspath(path).partition(PART)
    while mark:
        if Path(name).suffix.lower() in DECODERS and Path(name).is_file() and not whole.is_file():
            return Path(name), part
        further, mark, part = part.partition(PART)
        name = f"{name}{PART}{further}"
    return whole, ""


def load_tables(
    path: str | os.PathLike[str],
    columns: ColumnMap | None = None,
    form: FileFormat | None = None,
) -> list[Table]:
    """The tables in a file: one, or one for each sheet, segment, group or structure.

    Args:
        path: the file.
        columns: the lab's names of columns to ours.
        form: what the lab says about its files.
    Returns:
        Tables with a header and rows; of several, those that have a column for the time.
    Raises:
        TrialError: no such file, no table, or beyond a limit; names file, rule and fix.
    """
    path = as_path(path, TrialError)
    if path.is_dir():
        raise TrialError(f"{path} is a folder; name a file in it")
    read = DECODERS[known_suffix(path)]
    if not path.is_file():
        raise TrialError(f"there is no file {path}; check the name and the folder")
    request = Request(columns or {}, form or FileFormat())
    try:
        check_limit(path.name, "file_mib", path.stat().st_size / 2**20)
        content = path.read_bytes()
        if not content:
            raise UnreadableError(f"{path.name} is empty; {_NEEDED}")
        tables = _with_time(read(content, path.name, request), request)
        return [_without_repeats(table, request) for table in tables]
    except LimitError as error:
        raise TrialError(str(error)) from None
    except RecursionError:
        raise UnreadableError(f"{path.name} is nested too deep to be a table") from None


def load_table(
    path: str | os.PathLike[str],
    columns: ColumnMap | None = None,
    form: FileFormat | None = None,
) -> Table:
    """The one table in a file, or in the part that the path names.

    Raises:
        TrialError: as `load_tables`; several tables and no part named.
    """
    file, part = split_part(path)
    tables = load_tables(file, columns, form)
    if part:
        return _named(tables, part, file)
    if len(tables) > 1:
        names = ", ".join(repr(table.file) for table in tables[:_SHOWN])
        more = f" and {len(tables) - _SHOWN} more" if len(tables) > _SHOWN else ""
        raise TrialError(
            f"{file.name} holds {len(tables)} trials: {names}{more}; name one of them in place of "
            "the file, or read the folder as a data set, which takes each"
        )
    return tables[0]


def _named(tables: Sequence[Table], part: str, file: Path) -> Table:
    """The table of a part."""
    for table in tables:
        if table.part == part:
            return table
    names = [table.part for table in tables if table.part]
    raise TrialError(
        f"{file.name} has no part {part!r}{suggestion(part, names)}; it has "
        f"{', '.join(map(repr, names[:_SHOWN])) or 'one table: leave #... out'}"
    )


def _with_time(tables: list[Table], request: Request) -> list[Table]:
    """Of several tables those with a column for the time; the others are remarked."""
    for table in tables:
        if not table.header:
            raise UnreadableError(f"{table.file} is empty; {_NEEDED}")
    timed = [t for t in tables if t.rows and any(map(request.is_time, t.header))]
    if not timed:
        filled = [table for table in tables if table.rows]
        if not filled:
            cause = " that can be read: " + tables[0].remarks[-1] if tables[0].remarks else ""
            raise UnreadableError(
                f"{tables[0].file} has a header but no rows{cause or f'; {_NEEDED}'}"
            )
        return filled
    said = tuple(
        f"its part {table.part!r} is passed over: "
        + (
            f"it has no column time_s, only {_few(table.header)}"
            if table.rows
            else "it has no rows"
        )
        for table in tables
        if table not in timed
    )
    file = timed[0].file.partition(PART)[0] if len(timed) == 1 and said else timed[0].file
    timed[0] = replace(timed[0], file=file, remarks=(*timed[0].remarks, *said))
    return timed


def _few(names: Sequence[str]) -> str:
    shown = ", ".join(map(repr, names[:_SHOWN]))
    return f"{shown}..." if len(names) > _SHOWN else shown


def _without_repeats(table: Table, request: Request) -> Table:
    """The table without rows that repeat an earlier one in every cell, if time then increases.

    A sample cannot be taken twice at one instant; where time still does not increase, nothing tells
    which rows to leave out, and none is.
    """
    time = next((i for i, name in enumerate(table.header) if request.is_time(name)), 0)
    if _increases(table.cells[time]):
        return table
    seen: set[tuple[object, ...]] = set()
    keep: list[bool] = []
    for row in zip(*map(_listed, table.cells), strict=True):
        keep.append(row not in seen)
        seen.add(row)
    kept = [list(compress(_listed(cells), keep)) for cells in table.cells]
    gone = [number for number, stays in zip(table.rows, keep, strict=True) if not stays]
    # Where most rows are repeats, the clock stands still.
    if not gone or 2 * len(gone) > len(keep) or not _increases(kept[time]):
        return table
    shown = ", ".join(map(str, gone[:_SHOWN])) + (", ..." if len(gone) > _SHOWN else "")
    remark = (
        f"{len(gone)} rows repeat an earlier one in every cell and are passed over: row {shown}"
    )
    return replace(
        table,
        cells=kept,
        rows=list(compress(table.rows, keep)),
        remarks=(*table.remarks, remark),
    )


def _listed(cells: Cells) -> Sequence[object]:
    return cells.tolist() if isinstance(cells, np.ndarray) else cells


def _increases(cells: Cells) -> bool:
    """Whether times strictly increase, as numbers or else as texts."""
    if isinstance(cells, np.ndarray):
        return bool(np.all(np.diff(cells) > 0))
    mark = decimal_mark([cells])
    values = [cell_number(cell, mark) for cell in cells]
    if any(value is None for value in values):
        texts = [str(cell) for cell in cells]
        return len(set(texts)) == len(texts)
    return bool(np.all(np.diff(np.array(values, dtype=float)) > 0))
