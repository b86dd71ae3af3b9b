"""Values of a trial's columns: cells to numbers in the units of files, mapped and checked.

Numbers that loggers write where nothing was measured: -999, 9999, 1e30.
"""

import re
import warnings
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.files.trial_hints import mapping_line
from pma_gym.data.readers.clock import clock_seconds, epoch_seconds
from pma_gym.data.readers.layout import unit_factor
from pma_gym.data.readers.table import (
    Cells,
    FileFormat,
    Table,
    cell_number,
    has_groups,
    looks_ambiguous,
    shown,
)
from pma_gym.data.trial_checks import check_values
from pma_gym.data.trial_columns import ColumnMap, Source, TrialError

_MARKS = frozenset(
    {-6999.0, 7999.0, -7999.0, 8888.0, -8888.0, 32767.0, -32768.0, 65535.0}
    | {2147483647.0, -2147483648.0, 4294967295.0, -32767.0}
)
"""Marks of data loggers, and the ends of whole numbers."""

_VOID = 1e29
"""Smallest magnitude of which no sensor speaks."""
_FEW, _MOST = 0.2, 0.5
"""Largest share of a column that any number, and a known mark, takes as one."""
_FAR = 3.0
"""Spans of the other cells by which a known mark lies outside of them."""
_VERY_FAR = 10.0
"""The same for any other whole number that comes more than once."""
_LEAST = 90.0
"""Smallest magnitude of such a number."""
_LEAST = 10
"""Cells from which a column tells its bulk from a mark."""
_SHOWN = 5


def check_sentinels(source: Source, values: NDArray[np.float64], table: Table) -> None:
    """Refuse a column in which a few cells hold a mark for "not measured".

    A mark is a number far from all others in the column: of nines, the end of a whole number's
    range, or any whole number that comes more than once.

    Args:
        source: the column.
        values: its numbers as they stand in the file, NaN where a cell is empty.
        table: its file.
    Raises:
        TrialError: names the number, the cells and the fix.
    """
    mark = sentinel(values)
    if mark is None:
        return
    at = np.flatnonzero(values == mark)
    others = values[np.isfinite(values) & (values != mark)]
    rows = ", ".join(str(table.rows[int(i)]) for i in at[:_SHOWN])
    more = f" and {at.size - _SHOWN} more" if at.size > _SHOWN else ""
    raise TrialError(
        f"{source.name} of {table.file} is {mark:.10g} in row {rows}{more}, while its other cells "
        f"lie in {others.min():.6g} to {others.max():.6g}; it looks like a logger's mark for "
        "nothing measured: empty these cells, or, for all files at once, write "
        f"missing = [{mark:.17g}] under [format] of dataset.toml"
    )


def sentinel(values: NDArray[np.float64]) -> float | None:
    """The number in a column that stands for "not measured"; None if none does.

    Example:
        >>> sentinel(np.array([23.8, 23.9, -999.0, 24.0, 23.7, -999.0, 24.1, 24.2, 24.0, 23.9]))
        -999.0
    """
    finite = values[np.isfinite(values)]
    if finite.size < _LEAST:
        return None
    for extreme in (float(finite.min()), float(finite.max())):
        others = finite[finite != extreme]
        count = finite.size - others.size
        share = _MOST if _known(extreme) else _FEW
        if not others.size or count > max(1.0, share * finite.size):
            continue
        low, high = float(others.min()), float(others.max())
        if _known(extreme):
            bulk = _bulk(others)
            if _away(extreme, *bulk) > _FAR * max(bulk[1] - bulk[0], 1e-9 * abs(extreme)):
                return extreme
        elif (
            count > 1
            and extreme.is_integer()
            and abs(extreme) >= _LEAST
            and _away(extreme, low, high) > _VERY_FAR * (high - low) > 0.0
        ):
            return extreme
    return None


def _known(value: float) -> bool:
    """Whether a number is written as a mark: nines alone, or an end of whole numbers."""
    digits = f"{abs(value):.10g}".replace(".", "").rstrip("0")
    nines = len(digits) >= 3 and set(digits) == {"9"} and abs(value) >= 99.0
    return nines or value in _MARKS or abs(value) >= _VOID


def _bulk(values: NDArray[np.float64]) -> tuple[float, float]:
    """Where the cells lie that are no marks: a second mark does not widen it."""
    plain = np.array([value for value in np.unique(values) if not _known(float(value))])
    if not plain.size:
        plain = values
    return float(plain.min()), float(plain.max())


def _away(value: float, low: float, high: float) -> float:
    """Distance of a number from a range."""
    return max(low - value, value - high, 0.0)


_FAR_BEYOND = 9.0
"""Times a column's limit from which values are in another unit: per cent reach nearly ten times."""


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
    values = _clipped(values, source, table)
    fix = _beyond_fix(source, theirs, values)
    check_values(source.column.name, values, source.column, table.place, fix)
    return _within(values, source, table)


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
            share = sum(cell_number(each, mark, grouped) is None for each in cells) / len(cells)
            raise TrialError(
                f"{source.name} must hold numbers, {table.place(index)} has {shown(cell)}"
                f"{_fix(source, cell, mark, share)}"
            )
        theirs[index] = number
    return theirs


def _clipped(values: NDArray[np.float64], source: Source, table: Table) -> NDArray[np.float64]:
    """Values of a command, clipped to what its drive takes."""
    if source.limit is None:
        return values
    low, high = source.limit
    at = np.flatnonzero(np.isfinite(values) & ((values < low) | (values > high)))
    if at.size:
        warn(
            f"{table.file}: {source.name} lies beyond limit, {low:g} to {high:g} "
            f"{source.column.unit}, in {at.size} of {values.size} rows, the first row "
            f"{table.rows[int(at[0])]}; there it is clipped to it"
        )
    clipped = values.copy()
    clipped[at] = np.clip(values[at], low, high)
    return clipped


def _beyond_fix(source: Source, theirs: NDArray[np.float64], values: NDArray[np.float64]) -> str:
    """What to do about values beyond the limits of their column, by what they look like.

    Whole numbers far beyond are counts, which a factor converts. A command that mostly lies within
    is a controller's output before its saturation, which a factor would falsify.
    """
    column = source.column
    there = np.isfinite(values)
    if column.limits is None or not there.any():
        return ""
    low, high = column.limits
    line = f'write under [columns] of dataset.toml "{source.name}" = {{ name = "{column.name}", '
    factor = f"{line}factor = F }} with the {column.unit} of one unit of the log in place of F"
    kept = "".join(
        f"{key} = {value:.12g}, "
        for key, value, usual in (("factor", source.factor, 1.0), ("offset", source.offset, 0.0))
        if value != usual
    )
    clip = f"log what reached the drive, or clip to it: {line}{kept}limit = [{low:g}, {high:g}] }}"
    reach = float(np.max(np.abs(values[there]))) / high
    if bool(np.all(theirs[there] == np.rint(theirs[there]))) and reach > _FAR_BEYOND:
        return f"the log looks like raw DAQ counts: {factor}"
    if column.kind != "command":
        return f"if the log is in another unit, {factor}; else correct the reading"
    if reach <= _FAR_BEYOND or np.mean((values >= low) & (values <= high)) >= 0.5:
        return f"if it is a controller's output before its saturation, {clip}"
    return f"if it is a controller's output, {clip}; if it is in another unit, {factor}"


def _within(values: NDArray[np.float64], source: Source, table: Table) -> NDArray[np.float64]:
    """Values less those at an end of their sensor's range, which say only that it ends there."""
    if source.ends is None:
        return values
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


def _fix(source: Source, cell: object, mark: str, share: float) -> str:
    """What to do about a cell that is no number, as a share of its column's cells is none."""
    if looks_ambiguous(cell):
        assert isinstance(cell, str)
        comma = "," in cell
        both = ("a decimal comma", "grouped thousands") if comma else ("a point", "groups")
        point, group = ('"."', '","') if comma else ('","', '"."')
        return (
            f"; it may have {both[0]} or {both[1]}; write it without, or, for all files at once, "
            f"write decimal = {group if comma else point} under [format] of dataset.toml for a "
            f"decimal comma, decimal = {point if comma else group} for a decimal point"
        )
    if isinstance(cell, str) and re.fullmatch(r"\s*[+-]?\d*,\d+\s*", cell):
        return "; write it with a decimal point"
    if isinstance(cell, str) and mark == "," and re.fullmatch(r"\s*[+-]?\d*\.\d+\s*", cell):
        return "; write it with a decimal comma, as the other cells, or all of them with a point"
    if source.column.kind == "time":
        return (
            "; give seconds since the start of the trial, or dates and clock times with seconds, "
            "all of one form"
        )
    if isinstance(cell, str) and re.match(r"[^A-Za-z#]*\d", cell):
        return f"; it looks like a reading: write the number alone, in {source.column.unit}"
    if 2 * share > 1:
        return ", as have most of its cells: the column holds no numbers; remove or rename it"
    return "; leave the cell empty where nothing was measured"
