"""Channels of one file with clocks of their own: readings stand in the rows of their times."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.readers.table import Cells, Request
from pma_gym.data.trial_columns import TrialError

_TOLERANCE = 0.01
"""Part of the step between rows by which a reading may miss a row's time: no signal shows it."""


@dataclass(frozen=True)
class Channel:
    """Readings of a signal and, where the file says them, their times (s).

    Attributes:
        name: in the file.
        cells: readings.
        times: shape (n,), increasing; None where the file says none.
    """

    name: str
    cells: Cells
    times: NDArray[np.float64] | None


def reference_times(channels: Sequence[Channel], request: Request) -> NDArray[np.float64] | None:
    """The times that rows take: the first command's, else those that most channels have."""
    channels = [channel for channel in channels if len(channel.cells)]
    for channel in channels:
        if request.kind(channel.name) == "command":
            return channel.times
    timed = [c.times for c in channels if c.times is not None]
    counted = Counter(times.tobytes() for times in timed)
    return max(timed, key=lambda times: counted[times.tobytes()], default=None)


def on_rows(
    channel: Channel, rows: NDArray[np.float64], request: Request, file: str
) -> tuple[Cells | None, str]:
    """A channel's readings in the rows of their times.

    Args:
        channel: whose times may differ from the rows'.
        rows: times of the rows (s), shape (n,), increasing.
        request: known names.
        file: for messages.
    Returns:
        A cell for each row, None where the channel is passed over; and a remark, empty where the
        readings stand in their rows already.
    Raises:
        TrialError: a reading of a known column lies between two rows, or a command lacks rows.
    """
    times, cells = channel.times, channel.cells
    step = float(np.median(np.diff(rows))) if rows.size > 1 else 0.0
    near = _TOLERANCE * step
    if times is not None and times.size == rows.size and np.abs(times - rows).max() <= near:
        return cells, ""
    said = f"{channel.name!r} has readings {_words(times)}, the rows are {_words(rows)}"
    placed = _placed(cells, times, rows, near) if times is not None else None
    kind = request.kind(channel.name)
    if not isinstance(placed, list) or (kind == "command" and None in placed):
        if not kind:
            return None, f"{said}: it is passed over"
        one = f"the reading at {placed:.6g} s has" if isinstance(placed, float) else "they have"
        raise TrialError(
            f"{said}: {one} no row of {file} to stand in; resample all channels to one clock in "
            "the program that wrote the file, and save it again"
        )
    filled = sum(cell is not None for cell in placed)
    return placed, (
        f"{said}: {filled} of its {len(cells)} readings stand in the rows of their times, "
        f"{rows.size - filled} of {rows.size} rows have none"
    )


def _placed(
    cells: Cells, times: NDArray[np.float64], rows: NDArray[np.float64], near: float
) -> list[object] | float:
    """Readings in the rows of their times; else the time of the first that has no row."""
    inside = np.flatnonzero((times >= rows[0] - near) & (times <= rows[-1] + near))
    nearest = np.searchsorted((rows[1:] + rows[:-1]) / 2, times[inside])
    missed = np.abs(times[inside] - rows[nearest]) > near
    missed[1:] |= nearest[1:] == nearest[:-1]
    if missed.any() or not inside.size:
        return float(times[inside][missed][0] if inside.size else times[0])
    placed: list[object] = [None] * rows.size
    for row, index in zip(nearest.tolist(), inside.tolist(), strict=True):
        placed[row] = cells[index]
    return placed


def _words(times: NDArray[np.float64] | None) -> str:
    if times is None:
        return "at times that the file does not say"
    step = np.median(np.diff(times)) if times.size > 1 else 0.0
    return f"from {times[0]:.6g} to {times[-1]:.6g} s in steps of {step:.6g} s"
