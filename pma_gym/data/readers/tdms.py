"""National Instruments' TDMS files: channels of a group are columns."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.files.trial_formats import needed
from pma_gym.data.readers.clock import Channel, clock_seconds, on_rows, reference_times
from pma_gym.data.readers.table import PART, Cells, Request, Table
from pma_gym.data.readers.variables import NUMBERS
from pma_gym.limits import check_limit

_START = "wf_start_time"


def read(content: bytes, file: str, request: Request) -> list[Table]:
    """The tables in a TDMS file, one a group that has channels.

    Where no channel is the time, the waveforms' `wf_start_time`, `wf_start_offset` and
    `wf_increment` give it; a channel whose own differ is shifted to the rows of its times.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names.
    Returns:
        Tables.
    Raises:
        TrialError: npTDMS is missing, or a channel fits no row.
        LimitError: beyond a limit.
    """
    with needed("nptdms", file).TdmsFile.open(io.BytesIO(content)) as source:
        groups = [group for group in source.groups() if any(len(c) for c in group.channels())]
        check_limit(file, "sheets", len(groups))
        tables = []
        for group in groups:
            part = group.name.replace("/", "_")
            label = f"{file}{PART}{part}" if len(groups) > 1 else file
            tables.append(_table(group, label, part, request))
    if not tables:
        raise ValueError("it holds no channel with values")
    return tables


def _table(group: Any, file: str, part: str, request: Request) -> Table:  # noqa: ANN401
    channels = {channel.name: channel for channel in group.channels()}
    check_limit(file, "columns", len(channels))
    check_limit(file, "cells", sum(map(len, channels.values())))
    starts = [c.properties[_START] for c in channels.values() if _START in c.properties]
    signals = [
        Channel(name, _cells(channel), _times(channel, min(starts, default=None)))
        for name, channel in channels.items()
        if len(channel)
    ]
    time = next((signal for signal in signals if request.is_time(signal.name)), None)
    others = [signal for signal in signals if signal is not time]
    rows = reference_times(others, request)
    lengths = [len(signal.cells) for signal in others]
    if time is not None:
        size = len(time.cells)
        if rows is None or rows.size != size:
            rows = _seconds(time.cells)
        columns: dict[str, Cells] = {time.name: time.cells}
    else:
        size = max(lengths, key=lengths.count) if rows is None else rows.size
        columns = {} if rows is None else {"time_s": rows}
    remarks = []
    for signal in others:
        cells, said = signal.cells, ""
        if rows is not None and (signal.times is not None or time is None):
            cells, said = on_rows(signal, rows, request, file)
        elif len(cells) != size:
            said = (
                f"the channel {signal.name!r} is passed over, it has {len(cells)} values for {size}"
            )
            cells = None
        if cells is not None:
            columns[signal.name] = cells
        remarks += [said] if said else []
    named = [
        str(channels[n].properties.get("unit_string", "")) if n in channels else "" for n in columns
    ]
    units = {i: unit for i, unit in enumerate(named) if unit}
    return Table(
        file,
        list(columns),
        list(columns.values()),
        range(1, size + 1),
        part=part,
        units=units,
        remarks=tuple(remarks),
    )


def _cells(channel: Any) -> Cells:  # noqa: ANN401
    """A channel's values: numbers, or texts; dates are texts."""
    values = channel[:]
    if values.dtype.kind in NUMBERS:
        return np.asarray(values, dtype=np.float64)
    if values.dtype.kind == "M":
        return np.datetime_as_string(values, unit="us").tolist()
    return [str(value)[:200] for value in values.tolist()]


def _times(channel: Any, first: np.datetime64 | None) -> NDArray[np.float64] | None:  # noqa: ANN401
    """Times of a waveform (s) after the first start in the file; None if a property is missing."""
    start, step, shift = (
        channel.properties.get(name, usual)
        for name, usual in ((_START, None), ("wf_increment", None), ("wf_start_offset", 0.0))
    )
    if (
        (start is None) != (first is None)
        or not all(isinstance(x, int | float) and np.isfinite(x) for x in (shift, step))
        or step <= 0
    ):
        return None
    shift += 0.0 if first is None else (start - first) / np.timedelta64(1, "s")
    return shift + step * np.arange(len(channel))


def _seconds(cells: Cells) -> NDArray[np.float64] | None:
    """Seconds from the first row of a time channel; None where they do not increase."""
    times = cells - cells[0] if isinstance(cells, np.ndarray) else clock_seconds(cells)
    return times if times is not None and np.all(np.diff(times) > 0) else None
