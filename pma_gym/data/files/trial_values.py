"""Values of a trial's columns: cells to numbers in the units of files, mapped and checked."""

import re
import warnings
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.files.sentinels import check_sentinels
from pma_gym.data.files.trial_hints import mapping_line
from pma_gym.data.readers.cells import cell_number, has_groups, looks_ambiguous
from pma_gym.data.readers.clock import clock_seconds, epoch_seconds
from pma_gym.data.readers.table import Cells, FileFormat, Table, shown
from pma_gym.data.readers.units import unit_factor
from pma_gym.data.trial_checks import check_values
from pma_gym.data.trial_columns import ColumnMap, Source, TrialError

_COUNTS = "if the log is in raw DAQ counts, give [columns] a factor"


class TrialWarning(UserWarning):
    """Something in a trial's file was passed over; the message says what."""


def warn(message: str) -> None:
    """Warn of a trial's file, near the line that had it read."""
    warnings.warn(message, TrialWarning, stacklevel=5)


def check_units(known: list[Source], table: Table, mapping: ColumnMap) -> None:
    """Refuse a column whose unit in the file is another than its name's, unless it is mapped so.

    Raises:
        TrialError: names the column, both units and the fix.
    """
    for source in known:
        unit, entry = table.units.get(source.index), mapping.get(source.name)
        if unit is None or (isinstance(entry, Mapping) and "factor" in entry):
            continue
        factor = unit_factor(unit, source.column)
        if factor == 1.0:
            continue
        said = (
            f"{table.file} gives {source.name!r} the unit {shown(unit)}, but {source.column.name} "
            f"is in {source.column.unit}"
        )
        if factor is None:
            raise TrialError(
                f"{said}; correct the unit or the name, or write its factor under [columns] of "
                f"dataset.toml: {mapping_line(source.name, source.column, 2.0)} with the factor in "
                "place of 2"
            )
        raise TrialError(
            f"{said}; write under [columns] of dataset.toml: "
            f"{mapping_line(source.name, source.column, factor)}"
        )


def file_values(source: Source, table: Table, form: FileFormat, mark: str) -> NDArray[np.float64]:
    """A column's values in its unit in files, mapped and checked; NaN where a cell is empty.

    Args:
        source: which column, and how it is mapped.
        table: its file.
        form: what the lab says about its files.
        mark: the file's decimal mark.
    Raises:
        TrialError: names the cell, the rule and the fix.
    """
    cells = table.cells[source.index]
    if source.column.kind == "time":
        return _times(source, table, cells, mark)
    theirs = _numbers(source, table, cells, mark, form.decimal is not None)
    theirs[np.isin(theirs, form.missing)] = np.nan
    check_sentinels(source, theirs, table)
    with np.errstate(over="ignore"):
        values = source.factor * theirs + source.offset
    check_values(source.column.name, values, source.column, table.place, _COUNTS)
    return values if source.ends is None else _within(values, source, table)


def _times(source: Source, table: Table, cells: Cells, mark: str) -> NDArray[np.float64]:
    """Seconds of the time column: numbers as they are, dates and epochs from the first row."""
    clock = None if isinstance(cells, np.ndarray) else clock_seconds(cells)
    if clock is not None:
        if (source.factor, source.offset) != (1.0, 0.0):
            raise TrialError(
                f"{source.name} of {table.file} holds dates or clock times, so [columns] must give "
                "it no factor and no offset; remove them"
            )
        warn(
            f"{table.file}: {source.name} holds {shown(str(cells[0]))} in row {table.rows[0]}; it "
            "is converted to seconds from the first row"
        )
        return clock
    theirs = _numbers(source, table, cells, mark, grouped=False)
    values = source.factor * theirs + source.offset
    counted = epoch_seconds(values)
    if counted is None:
        return values
    values, unit = counted
    warn(f"{table.file}: {source.name} counts {unit} of a calendar; it is read from the first row")
    if source.factor != 1.0 and unit == "seconds":
        return (theirs - theirs[0]) * source.factor
    return values


def _numbers(
    source: Source, table: Table, cells: Cells, mark: str, grouped: bool
) -> NDArray[np.float64]:
    """A column's numbers; NaN where a cell is empty."""
    if isinstance(cells, np.ndarray):
        return np.array(cells, dtype=np.float64)
    grouped = has_groups(cells, mark, grouped)
    theirs = np.empty(len(cells))
    for index, cell in enumerate(cells):
        number = cell_number(cell, mark, grouped)
        if number is None:
            raise TrialError(
                f"{source.name} must hold numbers, {table.place(index)} has {shown(cell)}; "
                f"{_fix(source, cell, mark)}"
            )
        theirs[index] = number
    return theirs


def _within(values: NDArray[np.float64], source: Source, table: Table) -> NDArray[np.float64]:
    """Values less those at an end of their sensor's range, which say only that it ends there."""
    assert source.ends is not None
    low, high = source.ends
    with np.errstate(invalid="ignore"):
        beyond = (values <= low) | (values >= high)
    at = np.flatnonzero(beyond)
    if not at.size:
        return values
    first, last = table.rows[int(at[0])], table.rows[int(at[-1])]
    name = f"{source.name!r} ({source.column.name})" if source.name != source.column.name else ""
    warn(
        f"{table.file}: {name or source.name} is at an end of its range, {low:.6g} to {high:.6g} "
        f"{source.column.unit}, in {at.size} of {values.size} rows, row {first} to row {last}; "
        "there it counts as not measured"
    )
    return np.where(beyond, np.nan, values)


def _fix(source: Source, cell: object, mark: str) -> str:
    """What to do about a cell that is no number."""
    if looks_ambiguous(cell):
        assert isinstance(cell, str)
        comma = "," in cell
        both = ("a decimal comma", "grouped thousands") if comma else ("a point", "groups")
        point, group = ('"."', '","') if comma else ('","', '"."')
        return (
            f"it may have {both[0]} or {both[1]}; write it without, or, for all files at once, "
            f"write decimal = {group if comma else point} under [format] of dataset.toml for a "
            f"decimal comma, decimal = {point if comma else group} for a decimal point"
        )
    if isinstance(cell, str) and re.fullmatch(r"\s*[+-]?\d*,\d+\s*", cell):
        return "write it with a decimal point"
    if isinstance(cell, str) and mark == "," and re.fullmatch(r"\s*[+-]?\d*\.\d+\s*", cell):
        return "write it with a decimal comma, as the other cells, or all of them with a point"
    if source.column.kind == "time":
        return "give seconds since the start of the trial"
    return "leave the cell empty where nothing was measured"
