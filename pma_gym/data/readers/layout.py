"""Rows of a file to a table: where its header is, what stands around the samples.

Units as laboratories write them: `[mm]`, `(°)`, `kPa`, `Volts`.

Lines of a text, within the limits before there are any.
"""

import io
import re
from collections.abc import Mapping, Sequence

from pma_gym.data.files.trial_hints import FACTORS
from pma_gym.data.readers.clock import looks_like_clock
from pma_gym.data.readers.table import (
    NoHeaderError,
    Request,
    Table,
    bare_text,
    cell_number,
    decimal_mark,
    ranges,
    shown,
)
from pma_gym.data.trial_columns import Column, TrialError
from pma_gym.limits import check_limit, limit

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


Row = tuple[int, Sequence[object]]
"""Number of a row in its file, and its cells."""

COMMENTS = ("#", "%", "//")
"""What a line begins with that is a remark of the logger."""

_SEARCHED = 200
"""Rows from the top among which a header is looked for."""
_NUMBER = re.compile(
    r"[+-]?(?:[0-9][0-9.,'\u2019\u00a0\u2009\u202f]*|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?"
)
_LONGEST = 120


def arrange(
    file: str,
    rows: Sequence[Row],
    request: Request,
    *,
    provenance: Mapping[str, str] | None = None,
    part: str = "",
    padded: bool = False,
) -> Table:
    """The table in the rows of a file.

    A row without any number is no sample: above the samples it is a title, the header or the units;
    below them a footer. What is passed over is remarked.

    Args:
        file: name, for messages.
        rows: numbered rows that are not entirely empty.
        request: known names, and the lab's description of its files.
        provenance: metadata beside the table.
        part: name of the sheet or segment.
        padded: whether a short row lacks nothing but empty cells.
    Returns:
        The table; without a header if there are no rows.
    Raises:
        TrialError: no header, a row in the midst that is no sample, rows of unequal length.
    """
    rows, remarks = _without_comments(file, rows)
    if not rows:
        return Table(file, [], [], [], provenance or {}, part)
    at, header = _header(file, rows, request)
    if top := rows[: max(at, 0)]:
        remarks.append(f"{_span(top)} above the header {_are(top)} passed over")
    first = next((i for i in range(at + 1, len(rows)) if _is_sample(rows[i][1])), len(rows))
    units, others = _units(rows[at + 1 : first], len(header))
    time = next((i for i, name in enumerate(header) if request.is_time(name)), 0)
    last = next(
        (i for i in range(len(rows), first, -1) if _may_be_sample(rows[i - 1][1], time)), first
    )
    if first == last and (others or rows[last:]):
        remarks = [_unread((others or rows[last:])[0], header, time)]
    elif others:
        remarks.append(f"{_span(others)} below the header {_are(others)} passed over")
    if first < last < len(rows):
        remarks.append(f"{_span(rows[last:])} below the samples {_are(rows[last:])} passed over")
    samples = rows[first:last]
    check_limit(file, "cells", len(samples) * len(header))
    _check_rows(file, samples, header, padded)
    kept = [
        i for i, name in enumerate(header) if name or any(_filled(_at(r, i)) for _, r in samples)
    ]
    return Table(
        file,
        [header[i] for i in kept],
        [[_at(row, i) for _, row in samples] for i in kept],
        [number for number, _ in samples],
        provenance or {},
        part,
        {kept.index(i): unit for i, unit in units.items() if i in kept},
        tuple(remarks),
    )


def _at(row: Sequence[object], index: int) -> object:
    return row[index] if index < len(row) else None


def _filled(cell: object) -> bool:
    return cell is not None and not (isinstance(cell, str) and not cell.strip())


def _is_number(cell: object) -> bool:
    """Whether a cell is a number, or a text that is meant as one or as a date."""
    if isinstance(cell, str):
        if len(cell) > _LONGEST:
            return False
        bare = bare_text(cell)
        return _NUMBER.fullmatch(bare) is not None or looks_like_clock(bare)
    return isinstance(cell, int | float) and not isinstance(cell, bool)


def _is_sample(row: Sequence[object]) -> bool:
    """Whether a row holds a number at all."""
    return any(_is_number(cell) for cell in row)


def _may_be_sample(row: Sequence[object], time: int) -> bool:
    """Whether a row at the end may be a sample: not `End of file`, nor `Mean, 3.4`."""
    stamp = _at(row, time)
    return _is_sample(row) and (not _filled(stamp) or _is_number(stamp) or len(row) <= time)


def _without_comments(file: str, rows: Sequence[Row]) -> tuple[list[Row], list[str]]:
    """The rows without remarks of the logger; those in the midst are named."""
    marked = [i for i, row in enumerate(rows) if _comment(row)]
    if not marked:
        return list(rows), []
    kept = [row for i, row in enumerate(rows) if i not in set(marked)]
    leading = next((i for i in range(len(rows)) if not _comment(rows[i])), len(rows))
    amid = [rows[i] for i in marked if i > leading]
    return kept, [f"{_span(amid)} {_are(amid)} passed over as remarks"] if amid else []


def _comment(row: Row) -> bool:
    first = row[1][0] if row[1] else None
    return isinstance(first, str) and first.lstrip().startswith(COMMENTS)


def _header(file: str, rows: Sequence[Row], request: Request) -> tuple[int, list[str]]:
    """Position of the header among the rows, -1 if there is none, and its names."""
    form = request.format
    if form.names:
        return -1, list(form.names)
    if form.header_row is not None:
        at = next((i for i, (number, _) in enumerate(rows) if number == form.header_row), None)
        if at is None:
            raise TrialError(
                f"header_row in [format] is {form.header_row}, but {file} has no such row or it is "
                f"empty; its first row is {rows[0][0]}"
            )
        return at, _names(file, rows[at])
    searched = rows[:_SEARCHED]
    for i, (_, row) in enumerate(searched):
        named = any(request.is_time(_text(cell)) for cell in row)
        if named and not any(_is_number(cell) for cell in row):
            return i, _names(file, rows[i])
    first = next((i for i, (_, row) in enumerate(searched) if _begins_samples(row)), len(searched))
    above: list[int] = []
    for i in range(first - 1, -1, -1):
        if _is_sample(rows[i][1]):
            break
        above.append(i)
    if above:
        # The topmost of the fullest: a title is shorter, a row of units comes below.
        at = max(above, key=lambda i: (_count(rows[i][1]), -i))
        return at, _names(file, rows[at])
    raise _no_header(file, rows[first:] if first < len(rows) else rows)


def _begins_samples(row: Sequence[object]) -> bool:
    """Whether a row is of numbers mostly, its first cell too: not `delta t, 0.01`."""
    numbers = sum(_is_number(cell) for cell in row)
    first = next((cell for cell in row if _filled(cell)), None)
    return 2 * numbers > _count(row) and _is_number(first)


def _count(row: Sequence[object]) -> int:
    return sum(_filled(cell) for cell in row)


def _text(cell: object) -> str:
    return "" if cell is None else str(cell).strip()


def _names(file: str, row: Row) -> list[str]:
    """Names of the columns, "" where there is none."""
    names = [_text(cell) for cell in row[1]]
    for name in names:
        check_limit(f"the header of {file}", "cell_characters", len(name))
    check_limit(file, "columns", len(names))
    return names


def _no_header(file: str, rows: Sequence[Row]) -> TrialError:
    """What to say of a file that begins with its samples."""
    row, width = rows[0], _count(rows[0][1])
    mark = decimal_mark([[_at(cells, i) for _, cells in rows] for i in range(width)])
    columns = [[cell_number(_at(cells, i), mark) for _, cells in rows] for i in range(width)]
    example = ["time_s", "motor_voltage_v", "contraction_mm", "load_n"]
    return NoHeaderError(
        f"{file} has no header: row {row[0]}, its first, holds numbers; insert a row above it with "
        f"the names of its {width} column{'s' * (width > 1)} ({', '.join(example[:width])}...), or "
        f"name them for all files at once in dataset.toml: under [format], names = "
        f"[{', '.join(repr(name) for name in example[:width])}, ...] with {width} "
        f"name{'s' * (width > 1)}; {ranges(columns)}"
    )


def _unread(row: Row, header: Sequence[str], time: int) -> str:
    """Which cell of the first row below the header keeps it from being a sample, and why."""
    number, cells = row
    filled = [i for i, cell in enumerate(cells) if _filled(cell)]
    at = time if time in filled and not _is_number(cells[time]) else filled[0]
    name = f", column {header[at]!r}," if at < len(header) else ""
    return (
        f"row {number}{name} has {shown(_text(cells[at]))}, which is no number, no date and no "
        "clock time; write decimal numbers below the header (for the time, in seconds)"
    )


def _units(rows: Sequence[Row], width: int) -> tuple[dict[int, str], list[Row]]:
    """Units by column of the rows between header and samples, and the other rows there."""
    units: dict[int, str] = {}
    others: list[Row] = []
    for row in rows:
        filled = {i: _text(cell) for i, cell in enumerate(row[1][:width]) if _filled(cell)}
        known = {i: text for i, text in filled.items() if unit_of(text)}
        if not units and filled and 2 * len(known) >= len(filled):
            units = filled
        else:
            others.append(row)
    return units, others


def _check_rows(file: str, samples: Sequence[Row], header: Sequence[str], padded: bool) -> None:
    """Refuse rows of another length than the header's, and rows that are no samples."""
    width = len(header)
    least = max((i + 1 for i, name in enumerate(header) if name), default=0)
    for number, row in samples:
        if not _is_sample(row) and any(_filled(cell) for cell in row):
            again = [_text(cell) for cell in row[:width]] == list(header)
            raise TrialError(
                f"row {number} of {file} is no sample, it has {shown(_text(row[0]))}; "
                + (
                    "it is the header again: split the file there, or remove the row"
                    if again
                    else "remove the row, or let it begin with #"
                )
            )
        if (len(row) < least and not padded) or any(_filled(cell) for cell in row[width:]):
            raise TrialError(
                f"row {number} of {file} has {len(row)} cells, its header has {least}; complete "
                "the row, and write numbers with a decimal point (a decimal comma splits a cell)"
            )


def _span(rows: Sequence[Row]) -> str:
    """`row 3 ('End of file')` or `rows 3 to 5 (...)`."""
    said = shown(_text(next((cell for cell in rows[0][1] if _filled(cell)), "")))
    if len(rows) == 1:
        return f"row {rows[0][0]} ({said})"
    return f"rows {rows[0][0]} to {rows[-1][0]} ({said}...)"


def _are(rows: Sequence[Row]) -> str:
    return "is" if len(rows) == 1 else "are"


_QUOTED = 20
"""Times the most columns that a line with quotes may have separators: some stand in cells."""


def split_lines(text: str, file: str) -> list[str]:
    """Lines of a text, each with its end.

    Raises:
        LimitError: more than the rows that are read.
    """
    check_limit(file, "rows", max(text.count("\n"), text.count("\r")))
    return list(io.StringIO(text, newline=""))


def check_widths(lines: Sequence[str], separator: str, file: str) -> None:
    """Refuse lines with more cells than are read, before they are taken apart.

    Raises:
        LimitError: names the file and the limit.
    """
    most = limit("columns")
    for line in lines:
        count = 1 + line.count(separator)
        if count > most * (_QUOTED if '"' in line or separator == " " else 1):
            check_limit(file, "columns", count)
