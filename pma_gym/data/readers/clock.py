"""Dates, clock times and counted epochs of a time column to seconds from its first row.

Channels of one file with clocks of their own: readings stand in the rows of their times.
"""

import datetime
import re
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.readers.table import Cells, Request, cell_number
from pma_gym.data.trial_columns import TrialError

_NS = 1_000_000_000
_DAY_NS = 86_400 * _NS
_CLOCK = (
    r"(?P<h>[0-9]{1,2}):(?P<m>[0-9]{2}):(?P<s>[0-9]{2})"
    r"(?:[.,](?P<f>[0-9]{1,9})|:(?P<ms>[0-9]{3}))?"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?(?P<zone>Z|UTC|[+-][0-9]{2}:?[0-9]{2}))?"
)
_YEAR_FIRST = re.compile(
    rf"(?P<y>[0-9]{{4}})[-/.](?P<mo>[0-9]{{1,2}})[-/.](?P<d>[0-9]{{1,2}})(?:T|,? +){_CLOCK}"
)
_YEAR_LAST = re.compile(
    rf"(?P<a>[0-9]{{1,2}})(?P<by>[-/.])(?P<b>[0-9]{{1,2}})(?P=by)"
    rf"(?P<y>[0-9]{{4}}|[0-9]{{2}})(?:T|,? +){_CLOCK}"
)
_MONTH_NAMED = re.compile(
    rf"(?P<d>[0-9]{{1,2}})[- ](?P<name>[A-Za-z]{{3}})[- ](?P<y>[0-9]{{4}}),? +{_CLOCK}"
)
_TIME_ONLY = re.compile(_CLOCK)
_DURATION = re.compile(
    r"(?:(?P<d>[0-9]{1,4}) days?,? )?(?:(?P<h>[0-9]{1,4}):)?"
    r"(?P<m>[0-9]{1,3}):(?P<s>[0-9]{2})(?:[.,](?P<f>[0-9]{1,9}))?"
)
"""`00:00.010`, `26:00:00` and `0 days 00:00:00.010`; without a fraction or hours, `10:30` may be
hours and minutes."""
_COUNTED = re.compile(r"([+-]?[0-9.,eE+-]+) ?(sec|s|seconds|ms|min|hr)")
_UNITS = {"sec": 1.0, "s": 1.0, "seconds": 1.0, "ms": 1e-3, "min": 60.0, "hr": 3600.0}
_MONTHS: list[str] = list("jan feb mar apr may jun jul aug sep oct nov dec".split())
_LONGEST = 60
"""Characters of the longest date."""

EPOCHS = ((1e9, 5e9, 1.0, "seconds"), (1e12, 5e12, 1e-3, "milliseconds"),
          (1e15, 5e15, 1e-6, "microseconds"), (1e18, 5e18, 1e-9, "nanoseconds"))  # fmt: skip
"""From, to, seconds a count, its name: counts since 1970 (or 1904) of the years after 2001."""


def looks_like_clock(cell: object) -> bool:
    """Test whether a cell holds a date or a time of day."""
    return isinstance(cell, str) and any(_match(form, cell) for form in _FORMS)


def clock_seconds(cells: Cells) -> NDArray[np.float64] | None:
    """Seconds from the first row of a column of dates, times of day or counts with their unit.

    Args:
        cells: of the time column.
    Returns:
        Seconds, shape (n,), NaN where a cell is empty. None if the cells are plain numbers, are not
        all of one form, or leave open what is the day and what the month.
    """
    stamps = _texts(cells)
    if stamps is None or all(stamp is None for stamp in stamps):
        return None
    first = next(stamp for stamp in stamps if stamp is not None)
    return np.array([np.nan if stamp is None else (stamp - first) / _NS for stamp in stamps])


def epoch_seconds(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], str] | None:
    """Seconds from the first row of a column of counts since an epoch.

    Args:
        values: the time as numbers, shape (n,).
    Returns:
        Seconds and the name of what was counted; None if the first number is no such count.
    """
    first = float(values[0]) if values.size else 0.0
    for low, high, scale, name in EPOCHS:
        if low <= first < high:
            return (values - first) * scale, name
    return None


def _texts(cells: Cells) -> list[int | None] | None:
    """Nanoseconds of texts that all have one form."""
    bare = [cell.strip() if isinstance(cell, str) else cell for cell in cells]
    filled = [cell for cell in bare if cell not in (None, "")]
    if not filled or not all(isinstance(cell, str) for cell in filled):
        return None
    for form, read in _FORMS.items():
        if _match(form, filled[0]) is None:
            continue
        matches = [_match(form, cell) if cell else None for cell in bare]
        if sum(match is not None for match in matches) == len(filled):
            with suppress(ValueError):
                return read(matches)
    return None


_Matches = Sequence[re.Match[str] | None]


def _match(form: re.Pattern[str], cell: object) -> re.Match[str] | None:
    if not isinstance(cell, str) or len(cell) > _LONGEST:
        return None
    return form.fullmatch(cell.strip())


def _clock(match: re.Match[str]) -> int:
    """Nanoseconds since midnight, in the clock's own zone or in UTC if it is given."""
    hours, minutes, seconds = (int(match[name]) for name in "hms")
    if match["half"]:
        if not 1 <= hours <= 12:
            raise ValueError("no hour of a half day")
        hours = hours % 12 + (12 if match["half"] in "pP" else 0)
    if hours > 23 or minutes > 59 or seconds > 60:
        raise ValueError("no time of day")
    zone, shift = match["zone"], 0
    if zone and zone not in ("Z", "UTC"):
        shift = (int(zone[1:3]) * 60 + int(zone[-2:])) * (-60 if zone[0] == "-" else 60)
    fraction = int((match["f"] or match["ms"] or "0").ljust(9, "0"))
    return ((hours * 60 + minutes) * 60 + seconds - shift) * _NS + fraction


def _date(year: int, month: int, day: int) -> int:
    """Nanoseconds of a date since 1970."""
    return (datetime.date(year, month, day).toordinal() - 719_163) * _DAY_NS


def _year_first(matches: _Matches) -> list[int | None]:
    return [
        m and _date(int(m["y"]), int(m["mo"]), int(m["d"])) + _clock(m) for m in matches
    ]  # fmt: skip


def _month_named(matches: _Matches) -> list[int | None]:
    return [
        m and _date(int(m["y"]), 1 + _MONTHS.index(m["name"].lower()), int(m["d"])) + _clock(m)
        for m in matches
    ]


def _year_last(matches: _Matches) -> list[int | None]:
    """Dates with the year last; the order of day and month only matters where the date changes."""
    dates = {(m["a"], m["b"], m["y"], m["by"]) for m in matches if m}
    if len(dates) == 1:
        return [m and _clock(m) for m in matches]
    day_first = {a for a, _, _, by in dates if int(a) > 12 or by == "."}
    month_first = {b for _, b, _, by in dates if int(b) > 12}
    if bool(day_first) == bool(month_first):
        raise ValueError("day and month may be either")
    order = ("a", "b") if day_first else ("b", "a")
    return [
        m and _date(int(m["y"]) % 100 + 2000, int(m[order[1]]), int(m[order[0]])) + _clock(m)
        for m in matches
    ]


def _time_only(matches: _Matches) -> list[int | None]:
    return _past_end([m and _clock(m) for m in matches], _DAY_NS)


def _past_end(stamps: list[int | None], period: int) -> list[int | None]:
    """Times that begin at 0 again after a day or an hour: a step back by over half of it does."""
    periods, before, out = 0, None, []
    for stamp in stamps:
        if stamp is not None:
            if before is not None and stamp < before - period // 2:
                periods += 1
            before = stamp
            stamp += periods * period
        out.append(stamp)
    return out


def _durations(matches: _Matches) -> list[int | None]:
    """Time since a start; minutes without hours begin again after an hour."""
    hours = any(m and m["h"] for m in matches)
    if not hours and not any(m and m["f"] for m in matches):
        raise ValueError("hours and minutes, or minutes and seconds")
    stamps = [m and _duration(m) for m in matches]
    return stamps if hours else _past_end(stamps, 3600 * _NS)


def _duration(match: re.Match[str]) -> int:
    days, hours, minutes, seconds = (int(match[name] or 0) for name in "dhms")
    if seconds > 59 or (match["h"] and minutes > 59):
        raise ValueError("no duration")
    whole = ((days * 24 + hours) * 60 + minutes) * 60 + seconds
    return whole * _NS + int((match["f"] or "0").ljust(9, "0"))


def _counted(matches: _Matches) -> list[int | None]:
    """Numbers with their unit, all of them the same: `0.01 sec`."""
    if len({m[2] for m in matches if m}) > 1:
        raise ValueError("units differ")
    return [m and _nanoseconds(m) for m in matches]


def _nanoseconds(match: re.Match[str]) -> int:
    number = cell_number(match[1])
    if number is None or abs(number) > 1e9:
        raise ValueError("no number")
    return round(number * _UNITS[match[2]] * _NS)


_FORMS: dict[re.Pattern[str], Callable[[_Matches], list[int | None]]] = {
    _YEAR_FIRST: _year_first,
    _MONTH_NAMED: _month_named,
    _YEAR_LAST: _year_last,
    _TIME_ONLY: _time_only,
    _DURATION: _durations,
    _COUNTED: _counted,
}

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
