"""LabVIEW measurement files (.lvm) and other texts with National Instruments' headers.

A header of the file, then segments, each with a header of its own; every header ends with a line
`***End_of_Header***`. Source: National Instruments, "Specification for the LabVIEW Measurement File
(.lvm)", 2.0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.readers.clock import Channel, clock_seconds, on_rows, reference_times
from pma_gym.data.readers.layout import Row, arrange, check_widths, split_lines
from pma_gym.data.readers.table import Request, Table, UnreadableError, cell_number
from pma_gym.limits import check_limit

END = "***end_of_header***"
TIME, COMMENT = "X_Value", "Comment"
_NAMES = {"tab": "\t", "comma": ",", "semicolon": ";"}
_LONGEST_TIME = len("10:11:12.123456789")
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
    header, segments = _segments(split_lines(text, file), file, request)
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
    lowest = max(ends[n - 1] + 1, ends[n] - _LONGEST_HEADER)
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
    header, rows, remarks = segment.header, segment.rows, []
    names = [str(name) for name in rows[0][1]]
    if TIME in names and not any(request.is_time(name) for name in names):
        dimension = next((x for x in header.get("x_dimension", ()) if x), "time").lower()
        if dimension == "time" and not request.is_known(TIME):
            rows, remarks = _on_one_clock(rows, header, request, file)
    table = _without_comments(arrange(file, rows, request, part=str(number), padded=True))
    channels = [name for name in names if name != TIME]
    labels = dict(zip(channels, header.get("y_unit_label", ()), strict=False))
    units = {i: labels[name] for i, name in enumerate(table.header) if labels.get(name)}
    remarks = (*table.remarks, *remarks)
    return replace(table, units={**units, **table.units}, remarks=remarks)


def _on_one_clock(
    rows: list[Row], header: Header, request: Request, file: str
) -> tuple[list[Row], list[str]]:
    """Rows with one column of times, and each channel's readings in the rows of their times.

    `X_Value` says the times of the channel to its right (X_Columns Multi), or of the first (One).
    The header's X0, Delta_X, Date and Time say those of all channels (One, No).
    """
    names = [str(name) for name in rows[0][1]]
    columns = [[row[i] if i < len(row) else "" for _, row in rows[1:]] for i in range(len(names))]
    xs = [i for i, name in enumerate(names) if name == TIME]
    signals = [i for i, name in enumerate(names) if name not in (TIME, COMMENT, "")]
    mark = request.format.decimal or "."
    filled = [i for i in xs if any(columns[i])]
    multi = len(filled) > 1
    channels: list[Channel] = []
    for position, i in enumerate(signals):
        count = max((k for k, cell in enumerate(columns[i], start=1) if cell), default=0)
        cells = columns[i][:count]
        stamps = columns[max((x for x in xs if x < i), default=xs[0])][:count]
        if multi:
            times = _numbers(stamps, mark)
        else:
            times = _header_times(header, position, count, mark)
        if multi and times is None and stamps != columns[xs[0]][:count]:
            raise UnreadableError(
                f"{names[i]!r} of {file} has other times than the first channel, and they are no "
                "numbers; save the file with relative times"
            )
        channels.append(Channel(names[i], cells, times))
    if filled and not multi:
        clock = _header_times(header, 0, len(rows) - 1, mark)
    else:
        clock = reference_times(channels, request)
    if clock is not None and len(filled) != 1:
        columns[xs[0]] = clock.tolist()
    names[xs[0]] = "time_s"
    gone, remarks = set(xs[1:]), []
    for i, channel in zip(signals, channels, strict=True):
        if clock is None or not channel.cells:
            continue
        cells, said = on_rows(channel, clock, request, file)
        remarks += [said] if said else []
        if cells is None:
            gone.add(i)
        else:
            columns[i] = list(cells)
    kept = [i for i in range(len(names)) if i not in gone]
    size = len(columns[xs[0]])
    return [
        (rows[0][0], [names[i] for i in kept]),
        *(
            (rows[k + 1][0], [columns[i][k] if k < len(columns[i]) else "" for i in kept])
            for k in range(size)
        ),
    ], remarks


def _header_times(
    header: Header, position: int, count: int, mark: str
) -> NDArray[np.float64] | None:
    """A channel's times (s) after the first channel's Date and Time; None without a Delta_X."""

    def entry(key: str) -> str:
        entries = [*header.get(key, ()), ""]
        return entries[position] if position < len(entries) - 1 else entries[0]

    step, start = cell_number(entry("delta_x"), mark), cell_number(entry("x0"), mark)
    if step is None or start is None or not 0.0 < step < np.inf or abs(start) == np.inf:
        return None
    dated = zip(header.get("date", ()), header.get("time", ()), strict=False)
    shifts = clock_seconds([f"{date} {time[:_LONGEST_TIME]}" for date, time in dated])
    shift = 0.0 if shifts is None or position >= shifts.size else float(shifts[position])
    return shift + (0.0 if start != start else start) + step * np.arange(count, dtype=np.float64)


def _numbers(cells: Sequence[object], mark: str) -> NDArray[np.float64] | None:
    """Increasing numbers of cells; None if they are anything else."""
    values = [cell_number(cell, mark) for cell in cells]
    if not values or any(value is None for value in values):
        return None
    times = np.array(values, dtype=float)
    return times if np.all(np.diff(times) > 0) else None


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
