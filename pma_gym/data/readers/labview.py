"""LabVIEW measurement files (.lvm) and other texts with National Instruments' headers.

A header of the file, then segments, each with a header of its own; every header ends with a line
`***End_of_Header***`. Source: National Instruments, "Specification for the LabVIEW Measurement File
(.lvm)", 2.0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from pma_gym.data.readers.cells import cell_number
from pma_gym.data.readers.layout import Row, arrange
from pma_gym.data.readers.table import Request, Table, UnreadableError
from pma_gym.data.readers.text_lines import check_widths, split_lines
from pma_gym.limits import check_limit

END = "***end_of_header***"
TIME, COMMENT = "X_Value", "Comment"
_NAMES = {"tab": "\t", "comma": ",", "semicolon": ";"}
_LONGEST_HEADER = 500
"""Lines of a header."""

Header = Mapping[str, Sequence[str]]


@dataclass(frozen=True)
class _Segment:
    """Header and rows of a segment; the first row names its columns."""

    header: Header
    rows: list[Row]


def is_labview(text: str) -> bool:
    """Whether a text has such headers."""
    start = text[:100_000].lower()
    return text.startswith("LabVIEW Measurement") or f"\n{END}" in start or start.startswith(END)


def read_labview(text: str, file: str, request: Request) -> list[Table]:
    """The tables of a file's segments; segments that go on in time are one table.

    Args:
        text: of the file.
        file: its name, for messages.
        request: known names, and the lab's description of its files.
    Returns:
        One table, or one a segment; `X_Value` is `time_s` there.
    Raises:
        TrialError: no segment, or rows that are no table.
    """
    lines = split_lines(text, file)
    header, segments = _segments(lines, file, request)
    request = _with_decimal(request, header)
    tables = [
        _table(segment, f"{file}#{number}" if len(segments) > 1 else file, request, number)
        for number, segment in enumerate(segments, start=1)
    ]
    tables = [table for table in tables if table.rows]
    if not tables:
        raise UnreadableError(f"{file} has a LabVIEW header but no samples below it")
    joined = _joined(tables, file, request)
    return [joined] if joined else tables


def _with_decimal(request: Request, header: Header) -> Request:
    """The request with the decimal mark that the file names, if the lab names none."""
    mark = next(iter(header.get("decimal_separator", ())), "")
    if mark not in (".", ",") or request.format.decimal:
        return request
    return replace(request, format=replace(request.format, decimal=mark))


def _segments(lines: Sequence[str], file: str, request: Request) -> tuple[Header, list[_Segment]]:
    """The file's header and its segments."""
    ends = [i for i, line in enumerate(lines) if line.strip("\t ,;\r\n").lower() == END]
    check_limit(file, "sheets", len(ends))
    separator = request.format.separator or _separator(lines[: ends[0] if ends else 20], lines)
    check_widths(lines, separator, file)
    cells = [[cell.strip() for cell in line.rstrip("\r\n").split(separator)] for line in lines]
    check_limit(file, "cells", sum(map(len, cells)))
    if not ends:
        raise UnreadableError(f"{file} begins as a LabVIEW file, but no header ends in it")
    header = _fields(cells[: ends[0]])
    segments: list[_Segment] = []
    starts = [_header_start(cells, ends, n) for n in range(1, len(ends))]
    if not starts:
        # One header alone: the samples follow it.
        starts, ends = [0], ends[:1]
    else:
        ends = ends[1:]
    for n, end in enumerate(ends):
        stop = starts[n + 1] if n + 1 < len(starts) else len(cells)
        rows: list[Row] = [
            (i + 1, cells[i]) for i in range(end + 1, stop) if any(cell for cell in cells[i])
        ]
        segments.append(_Segment(_fields(cells[starts[n] : end]), rows))
    return header, segments


def _separator(header: Sequence[str], lines: Sequence[str]) -> str:
    """What the file says that it separates cells by."""
    for line in header:
        for mark in _NAMES.values():
            key, _, value = line.strip().partition(mark)
            if key.lower() == "separator" and value.strip(" \t,;").lower() in _NAMES:
                return _NAMES[value.strip(" \t,;").lower()]
    counts = {mark: sum(mark in line for line in lines[-20:]) for mark in ("\t", ";", ",")}
    return max(counts, key=lambda mark: counts[mark])


def _header_start(cells: Sequence[Sequence[str]], ends: Sequence[int], n: int) -> int:
    """First line of the n-th header: `Channels` begins it, below the samples before."""
    floor = ends[n - 1] + 1
    lowest = max(floor, ends[n] - _LONGEST_HEADER)
    for i in range(ends[n] - 1, lowest - 1, -1):
        if cells[i][0].lower() == "channels":
            return i
    return lowest


def _fields(cells: Sequence[Sequence[str]]) -> Header:
    """A header's values by name in lower case."""
    return {row[0].lower(): list(row[1:]) for row in cells if row and row[0]}


def _table(segment: _Segment, file: str, request: Request, number: int) -> Table:
    """The table of a segment."""
    if not segment.rows:
        return Table(file, [], [], [], part=str(number))
    names = segment.rows[0][1]
    rows = segment.rows
    if TIME in names and not any(request.is_time(name) for name in names):
        dimension = next((x for x in segment.header.get("x_dimension", ()) if x), "time").lower()
        if dimension == "time" and not request.is_known(TIME):
            names = ["time_s" if name == TIME else name for name in names]
            rows = [(rows[0][0], names), *rows[1:]]
    rows = _without_extra_times(rows, file)
    rows = _with_times(rows, segment.header, request)
    table = arrange(file, rows, request, part=str(number), padded=True)
    return _with_units(_without_comments(table), segment.header)


def _without_extra_times(rows: list[Row], file: str) -> list[Row]:
    """Rows with one column of times, where the file has one for each channel and all are equal."""
    names = list(rows[0][1])
    at = [i for i, name in enumerate(names) if name == "time_s"]
    if len(at) < 2:
        return rows
    for number, row in rows[1:]:
        stamps = {row[i] for i in at if i < len(row) and row[i]}
        if len(stamps) > 1:
            raise UnreadableError(
                f"row {number} of {file} has a time for each channel, and they differ; save the "
                "file with X_Columns One"
            )
    gone = set(at[1:])
    return [(number, [c for i, c in enumerate(row) if i not in gone]) for number, row in rows]


def _with_times(rows: list[Row], header: Header, request: Request) -> list[Row]:
    """Rows with the times that X0 and Delta_X give, where the file leaves their column empty."""
    names = list(rows[0][1])
    if "time_s" not in names:
        return rows
    at = names.index("time_s")
    if any(at < len(row) and row[at] for _, row in rows[1:]):
        return rows
    mark = request.format.decimal or "."
    start, step = (
        cell_number(next((x for x in header.get(key, ()) if x), ""), mark)
        for key in ("x0", "delta_x")
    )
    if not step or start is None or step != step:
        return rows
    start = 0.0 if start != start else start
    filled: list[Row] = [rows[0]]
    for index, (number, row) in enumerate(rows[1:]):
        cells: list[object] = list(row) + [""] * (at + 1 - len(row))
        cells[at] = start + index * step
        filled.append((number, cells))
    return filled


def _without_comments(table: Table) -> Table:
    """The table without LabVIEW's column of comments; comments that there are are remarked."""
    if COMMENT not in table.header:
        return table
    at = list(table.header).index(COMMENT)
    written = [
        f"{table.rows[i]} ({cell!r})"
        for i, cell in enumerate(table.cells[at])
        if isinstance(cell, str) and cell.strip()
    ]
    said = (
        (f"the column {COMMENT} is passed over, it is filled in row {written[0]}",)
        if written
        else ()
    )
    keep = [i for i in range(len(table.header)) if i != at]
    return replace(
        table,
        header=[table.header[i] for i in keep],
        cells=[table.cells[i] for i in keep],
        remarks=(*table.remarks, *said),
    )


def _with_units(table: Table, header: Header) -> Table:
    """The table with the units that a segment's header gives, one a channel."""
    labels = header.get("y_unit_label", ())
    channels = [i for i, name in enumerate(table.header) if name != "time_s"]
    units = {i: label for i, label in zip(channels, labels, strict=False) if label}
    return replace(table, units={**units, **table.units})


def _joined(tables: Sequence[Table], file: str, request: Request) -> Table | None:
    """One table of segments with the same columns whose times go on; None if they do not."""
    if len(tables) == 1:
        return replace(tables[0], file=file, part="")
    first = tables[0]
    time = next((i for i, name in enumerate(first.header) if request.is_time(name)), None)
    if time is None or any(list(t.header) != list(first.header) for t in tables):
        return None
    mark = request.format.decimal or "."
    last = -float("inf")
    for table in tables:
        begin, end = (cell_number(table.cells[time][k], mark) for k in (0, -1))
        if begin is None or end is None or not begin > last:
            return None
        last = end
    said = f"its {len(tables)} segments go on in time and are read as one trial"
    return replace(
        first,
        file=file,
        part="",
        cells=[[c for t in tables for c in t.cells[i]] for i in range(len(first.header))],
        rows=[number for table in tables for number in table.rows],
        remarks=(*(remark for table in tables for remark in table.remarks), said),
    )
