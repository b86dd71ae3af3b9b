"""Times that repeat or fall back: where, by how much, how often, and the fix for their cause.

Rows out of order are sorted; a file of several trials is split; a clock that was set back or began
again at the end of its range goes on where the missing time is added; a clock of too few digits is
replaced. To sort in the other cases would mix rows that do not belong together.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Place = Callable[[int], str]
"""Says where the sample of an index stands: `row 381 of ramp.csv`."""

_SHOWN = 3
_SORT = "the rows are out of order: sort them by time_s"
_SCATTER = (
    "the clock's readings scatter by more than a row: write each row's number times the period, "
    "or, if the rows were shuffled, sort them by time_s"
)
_NEAR = 3.0
"""Usual steps within which two times are one place of a clock."""
_MANY = 0.2
"""Share of rows that share their time with another from which the clock has too few digits."""
_RANGES_S = (60.0, 3600.0, 43_200.0, 86_400.0) + tuple(
    unit * 2.0**bits for unit in (1.0, 1e-3, 1e-6) for bits in (16, 24, 31, 32)
)
"""Ranges of clocks (s): a minute, an hour, half a day, a day, and counters of 16 to 32 bits."""


def time_disorder(time: Array, place: Place) -> str:
    """Describe where times do not increase, and what to do about it; empty where all do.

    Args:
        time: finite times (s), shape (n,).
        place: where a sample stands.

    Example:
        >>> time_disorder(np.array([0.0, 0.1, 0.3, 0.2, 0.4]), "row {}".format)
        'row 3 has 0.2 s after 0.3 s; the rows are out of order: sort them by time_s'
    """
    steps = np.diff(time)
    at = 1 + np.flatnonzero(steps <= 0)
    if not at.size:
        return ""
    said = f"{place(int(at[0]))} has {float(time[at[0]])!r} s after {float(time[at[0] - 1])!r} s"
    if at.size > 1:
        falls = -steps[at - 1]
        span = " to ".join(dict.fromkeys(f"{fall:.6g}" for fall in (falls.min(), falls.max())))
        said += (
            f", and so on in {at.size} of {steps.size} steps ({_rows(at, place)}), where it falls "
            f"back by {span} s"
        )
    backward = at[steps[at - 1] < 0]
    fix = _fix_backward(time, backward, place) if backward.size else _fix_repeats(time, at)
    return f"{said}; {fix}"


def _rows(at: Sequence[int] | NDArray[np.intp], place: Place) -> str:
    """The first places of some samples: `row 3, row 9, row 12 and 30 more`."""
    first = ", ".join(place(int(each)).partition(" of ")[0] for each in at[:_SHOWN])
    return first + (f" and {len(at) - _SHOWN} more" if len(at) > _SHOWN else "")


def _fix_repeats(time: Array, at: NDArray[np.intp]) -> str:
    """What to do about times that repeat and never fall back."""
    if time[0] == time[-1]:
        return "the clock stands still: write the time of each row, its number times the period"
    if at.size > max(1.0, _MANY * time.size):
        ticks = np.diff(np.unique(time))
        return (
            f"the clock has too few digits for these rows, it goes on by {ticks.min():.3g} s or "
            "more: log more digits, or write each row's number times the period"
        )
    return "two rows have one time: correct it, or remove the row that is wrong"


def _fix_backward(time: Array, back: NDArray[np.intp], place: Place) -> str:
    """What to do about times that fall back before some samples."""
    steps = np.diff(time)
    if not (steps > 0).any():
        return "the rows run backwards, the newest first: sort them by time_s"
    ordered = np.diff(np.sort(time))
    middle = float(np.median(ordered))
    even = ordered.min() >= 0.7 * middle > 0 and ordered.max() <= 1.5 * middle
    if back.size > max(1.0, _MANY * time.size):
        return _SORT if even else _SCATTER
    usual = float(np.median(steps[steps > 0]))
    near = _NEAR * usual
    # What is missing for the clock to go on by its usual step.
    missing = usual - steps[back - 1]
    period = float(np.median(missing))
    known = [each for each in _RANGES_S if abs(period - each) < usual]
    begins = (np.abs(time[back] - time[0]) <= near) & (time[back - 1] - time[0] > 2.0 * near)
    where = _rows(back, place)
    add = f"add {known[0] if known else period:.9g} s to every row from {where} on"
    split = f"split the file there, before {where}, one file a trial"
    if known and np.ptp(missing) < near:
        if begins.all():
            return (
                f"where the rig went on, the clock began its range of {known[0]:.9g} s again: {add}"
                f"; where a new trial begins, {split}"
            )
        return (
            f"the clock began its range of {known[0]:.9g} s again, or was set back by it (daylight "
            f"saving time): {add}"
        )
    if begins.all():
        return f"the clock begins again, a new trial: {split}"
    # Where rows changed places, times jump forwards by as much as they fall back; gaps stay.
    excess = [each[each > 1.5 * usual] - usual for each in (steps, ordered)]
    jumps = float(np.sum(excess[0]) - np.sum(excess[1]))
    if even or (ordered.min() > 0 and 0.5 < jumps / float(np.sum(missing)) < 2.0):
        return _SORT
    if all([np.isin(time[i : _next(time, i)], time[:i]).all() for i in back]):
        return (
            f"from {where} on, rows have times of rows before them: remove one copy where both "
            "hold the same readings"
        )
    elapsed = time[back - 1] - time[np.concatenate([[0], back[:-1]])]
    if np.all(missing > 0.5 * elapsed):
        return f"the clock begins again, a new trial: {split}"
    return f"the clock was set back: {add}" + (
        ", by as much as it fell back and a step" if np.ptp(missing) > near else ""
    )


def _next(time: Array, index: int) -> int:
    """Index of the first sample from one on that is later than all before that one."""
    later = np.flatnonzero(time[index:] > time[:index].max())
    return index + int(later[0]) if later.size else time.size
