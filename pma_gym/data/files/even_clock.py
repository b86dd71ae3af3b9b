"""Time stamps that a logger rounded: recognised, and set back to the even steps of its clock.

A clock of 384 Hz written with three decimals steps by 2 or 3 ms. Taken literally, such stamps
shake every moving signal by half a millisecond of its speed, which looks like mains hum. Stamps
that an even clock explains, each within half of the last digit, are that clock's.

Commands of a slower writer: in every second or twelfth row only, the cells between them empty.

Whether such a command stands still until its next value or moves there in a line, the log does not
say: `interpolation` under `[format]` of a `dataset.toml` does, "zoh" (held, the default) or "foh".
A hole so long that it is a gap is never joined.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.quality.gaps import LONGEST_S, TIMES
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY

Array = NDArray[np.float64]

QUANTA_S = (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5)
"""Last digits that a logger may round to (s)."""

LEAST_ROWS = 16
"""Fewest rows that show an even clock."""

MATTERS = 0.01
"""Share of a step that rounding must be, to matter: less shakes no signal beyond its noise."""

LEAST_SHARE, LEAST_COUNT = 0.01, 5
"""Share and number of steps that must be of the rarer length where the other is one last digit: a
few longer steps are rows that are missing, not rounding."""

TOLERANCE = 0.6
"""Largest distance of a stamp from the even clock, in last digits: half of one, and what a straight
line through rounded stamps may be off."""

WHOLE = 2e-3
"""Distance from a whole number of last digits that is floating point's (time may count from
1970)."""


@dataclass(frozen=True)
class EvenClock:
    """An even clock behind rounded stamps.

    Attributes:
        time: its times (s), the first as it was stamped, shape (n,).
        quantum: last digit of the stamps (s).
        step: the clock's step (s).
    """

    time: Array
    quantum: float
    step: float

    def words(self) -> str:
        """Text of the warning: how the stamps are rounded, and how they are read."""
        return (
            f"time_s is rounded to {1e3 * self.quantum:g} ms by the logger, steps of "
            f"{1e3 * self.step:.6g} ms ({1.0 / self.step:.6g} Hz) explain every stamp: the even "
            "steps are used"
        )


def even_clock(time: Array) -> EvenClock | None:
    """The even clock whose rounded times some stamps are.

    Args:
        time: stamps (s), shape (n,), none before another; equal ones may follow each other.
    Returns:
        The clock; None where the stamps are even as they stand, finer than matters, or of no
        even clock. Rows may be missing.
    """
    if time.size < LEAST_ROWS or not np.isfinite(time).all():
        return None
    since = time - time[0]
    quantum = _quantum(since)
    if quantum is None:
        return None
    steps = np.diff(np.rint(since / quantum))
    if (steps < 0).any() or (steps == steps[0]).all():
        return None
    usual = float(np.median(steps))
    short = usual - 1.0 if np.sum(steps == usual - 1.0) > np.sum(steps == usual + 1.0) else usual
    long = short + 1.0
    rarer = min(np.sum(steps == short), np.sum(steps == long))
    # A row that is missing makes a step of 1 one of 2: then rounding must show more often.
    least = max(LEAST_COUNT, LEAST_SHARE * steps.size) if short <= 1.0 else 1
    if (steps < short).any() or rarer < least:
        return None
    counts = _counts(steps, long)
    step, offset = np.polyfit(counts, since, 1)
    away = np.max(np.abs(since - offset - step * counts))
    if away > TOLERANCE * quantum or quantum < MATTERS * step:
        return None
    return EvenClock(time[0] + step * counts, quantum, float(step))


def _quantum(since: Array) -> float | None:
    """The coarsest last digit of which all times are whole multiples."""
    for quantum in QUANTA_S:
        multiples = since / quantum
        if np.max(np.abs(multiples - np.rint(multiples))) < WHOLE:
            return quantum
    return None


def _counts(steps: Array, long: float) -> Array:
    """How many steps of the clock lie before each stamp: one a row, more where rows are missing."""
    gaps = steps > long
    whole = max(np.split(steps, np.flatnonzero(gaps)), key=len)
    mean = float(np.mean(whole[whole <= long]))
    each = np.where(gaps, np.maximum(1.0, np.rint(steps / mean)), 1.0)
    return np.concatenate([[0.0], np.cumsum(each)])


_ROUNDING = 1e-9
"""Share of a command's range in which two values are one."""


def joined(values: Array, time: Array) -> Array:
    """A command with its empty cells (NaN) filled by lines between its values, but for gaps.

    Args:
        values: of the command, shape (n,).
        time: increasing times (s), shape (n,).
    """
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2:
        return values
    apart = np.diff(time[known])
    limit = max(LONGEST_S, TIMES * float(np.median(apart)))
    before = np.searchsorted(known, np.arange(values.size), side="right") - 1
    bridged = apart[np.clip(before, 0, apart.size - 1)] <= limit
    lines = np.interp(time, time[known], values[known], left=np.nan, right=np.nan)
    return np.where(np.isnan(values) & bridged, lines, values)


def held_commands(trial: Trial, stated: bool) -> Iterator[str]:
    """Messages on commands that are held over empty cells, where a line would be another command.

    Args:
        trial: what was read.
        stated: whether `[format]` says so.
    """
    for name, values in trial.commands.items():
        known = np.isfinite(values)
        if known.all() or not known.any():
            continue
        last = np.maximum.accumulate(np.where(known, np.arange(values.size), 0))
        lines = joined(values, trial.time)
        with np.errstate(invalid="ignore"):
            other = np.abs(lines - values[last]) > _ROUNDING * np.ptp(values[known])
        if other.any():
            column = BY_QUANTITY[name].name
            why = (
                ', as interpolation = "zoh" under [format] says'
                if stated
                else '; if it goes to its next value in a line, write interpolation = "foh" under '
                '[format] of dataset.toml, else interpolation = "zoh"'
            )
            yield (
                f"{column} is empty in {np.sum(~known)} of {known.size} rows, there it is held at "
                f"the value before{why}"
            )
