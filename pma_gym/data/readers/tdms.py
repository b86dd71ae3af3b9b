"""National Instruments' TDMS files: channels of a group are columns."""

import io
import logging
from typing import Any

import numpy as np

from pma_gym.data.readers.libraries import needed
from pma_gym.data.readers.table import PART, Cells, Request, Table, UnreadableError
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import LimitError, check_limit

_WIDEST = 16
"""Bytes of the widest value that a channel holds."""


def read_tdms(content: bytes, file: str, request: Request = Request()) -> list[Table]:  # noqa: B008
    """The tables in a TDMS file, one a group that has channels.

    Where no channel is the time, the waveform's `wf_start_offset` and `wf_increment` give it.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names.
    Returns:
        Tables.
    Raises:
        TrialError: npTDMS is missing or cannot read it, or it is beyond a limit.
    """
    nptdms = needed("nptdms", file)
    _silence()
    try:
        with nptdms.TdmsFile.open(io.BytesIO(content)) as source:
            tables = _tables(source, file, request, len(content))
    except (TrialError, LimitError):
        raise
    # npTDMS raises ValueError, KeyError, struct.error, IndexError... for damaged files.
    except Exception as error:
        said = str(error).partition("\n")[0][:200] or type(error).__name__
        raise UnreadableError(f"{file} is not a readable TDMS file: {said}") from None
    if not tables:
        raise UnreadableError(
            f"{file} is not a readable TDMS file: it holds no channel with values"
        )
    return tables


def _silence() -> None:
    """Keep npTDMS from printing a line for each oddity of each segment: one message is enough."""
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "nptdms":
            logging.getLogger(name).setLevel(logging.CRITICAL)


def _tables(source: Any, file: str, request: Request, size: int) -> list[Table]:  # noqa: ANN401
    groups = [group for group in source.groups() if any(len(c) for c in group.channels())]
    check_limit(file, "sheets", len(groups))
    tables = []
    for group in groups:
        part = group.name.replace("/", "_")
        label = f"{file}{PART}{part}" if len(groups) > 1 else file
        tables.append(_table(group, label, part, request, size))
    return tables


def _table(group: Any, file: str, part: str, request: Request, size: int) -> Table:  # noqa: ANN401
    channels = [channel for channel in group.channels() if len(channel)]
    check_limit(file, "columns", len(channels))
    lengths = [len(channel) for channel in channels]
    # Values are not packed: a file cannot hold more of them than it has bits.
    if sum(lengths) > 8 * size:
        raise ValueError(f"it declares {sum(lengths)} values in {size} bytes")
    check_limit(file, "cells", sum(lengths))
    time = next((c for c in channels if request.is_time(c.name)), None)
    rows = len(time) if time is not None else max(lengths, key=lengths.count)
    taken = [channel for channel in channels if len(channel) == rows]
    header = [channel.name for channel in taken]
    cells: list[Cells] = [_cells(channel) for channel in taken]
    remarks = [
        f"the channel {c.name!r} is passed over, it has {len(c)} values for {rows}"
        for c in channels
        if len(c) != rows
    ]
    units = {i: str(c.properties.get("unit_string", "")) for i, c in enumerate(taken)}
    clock = None if time is not None else _waveform(taken, rows)
    if clock is not None and "time_s" not in header:
        header, cells = ["time_s", *header], [clock, *cells]
        units = {i + 1: unit for i, unit in units.items()}
    units = {i: unit for i, unit in units.items() if unit}
    return Table(
        file, header, cells, range(1, rows + 1), part=part, units=units, remarks=tuple(remarks)
    )


def _cells(channel: Any) -> Cells:  # noqa: ANN401
    """A channel's values: numbers, or dates as datetimes."""
    values = channel[:]
    if values.dtype.kind in "fiu":
        return np.asarray(values, dtype=np.float64)
    if values.dtype.kind == "M":
        return values.astype("datetime64[us]").tolist()
    return [str(value)[:200] for value in values.tolist()]


def _waveform(channels: Any, rows: int) -> np.ndarray | None:  # noqa: ANN401
    """Times of waveforms (s), if all channels have the same."""
    clocks = {
        (c.properties.get("wf_start_offset", 0.0), c.properties.get("wf_increment"))
        for c in channels
    }
    if len(clocks) != 1:
        return None
    start, step = next(iter(clocks))
    good = all(isinstance(x, int | float) and np.isfinite(x) for x in (start, step))
    return start + step * np.arange(rows) if good and step > 0 else None
