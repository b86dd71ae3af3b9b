"""Clipped sensors, detected from their readings.

A reading at an end says only that the truth lies beyond. Ends that are known (of raw volts, or
`range` in `[columns]` and `[sensors]`) are seen when a file is read; this module finds the others:
the station's DAQ, where readings keep to its levels; and those that nobody wrote down: a sensor
that stands exactly at its largest or smallest reading for long, while the commands move and
although its readings nowhere else stand as long.

Readings of the station's 12-bit DAQ, known by their levels.

Steps and ends of that DAQ hold only for its own readings. A signal was read by it if its readings
differ from each other by whole steps of it; those of another lab's sensor do not.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.calibration import DAQ_LIMIT, DAQ_STEP
from pma_gym.data.signals import SIGNALS, Signal
from pma_gym.data.trial import MEASUREMENTS, Trial
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

MISS = 0.05
"""Share of a step that a reading may miss a whole one by: files round."""


def read_by_daq(signal: Signal, readings: Array) -> bool:
    """Test whether readings (SI, NaN for none) differ by whole steps of the DAQ."""
    if signal.calibration is None:
        return False
    known = readings[np.isfinite(readings)]
    if not known.size:
        return False
    steps = (known - known[0]) / signal.resolution
    return bool(np.all(np.abs(steps - np.round(steps)) < MISS))


def at_daq_end(signal: Signal, readings: Array) -> NDArray[np.bool_]:
    """Mark readings (SI, any shape) at an end of the DAQ's range; none of other sensors.

    Such a reading is only a bound on the true value.
    """
    nowhere = np.zeros(readings.shape, bool)
    # Counted from its start, a signal no longer tells at which level it began.
    if signal.calibration is None or signal.starts_at_zero:
        return nowhere
    volts = np.abs(signal.calibration.to_volts(readings))
    at = volts >= DAQ_LIMIT - (1.0 + MISS) * DAQ_STEP
    beyond = volts > DAQ_LIMIT + MISS * DAQ_STEP
    return at if at.any() and not beyond.any() and read_by_daq(signal, readings) else nowhere


Rows = NDArray[np.bool_]

LEAST_ROWS = 8
"""Fewest equal readings in a row that an end of a range is known by."""

TIMES = 4.0
"""How many times as long as anywhere else they must last: a coarse sensor stands still at rest."""

JUMP = 3.0
"""How many steps between readings the line through the readings before must lead beyond."""

BEFORE = 5
"""Readings that this line is drawn through."""

NEAR = 3
"""Rows between two readings at an end that count as at the end too."""


@dataclass(frozen=True)
class End:
    """A sensor at an end of its range.

    Attributes:
        quantity: what it senses.
        value: its reading there (SI).
        rows: by number of the trial, which rows are there.
    """

    quantity: str
    value: float
    rows: Mapping[int, Rows]

    def words(self, names: Sequence[str], trials: Sequence[Trial]) -> str:
        """Text of the warning: column, value, files, rows and consequence."""
        column = BY_QUANTITY[self.quantity]
        places = []
        for number, rows in self.rows.items():
            at, time = np.flatnonzero(rows), trials[number].time
            places.append(
                f"{len(at)} readings of {names[number]}, number {at[0] + 1} to {at[-1] + 1} "
                f"({time[at[0]]:.4g} to {time[at[-1]]:.4g} s)"
            )
        shown = "; ".join(places[:3]) + (f"; {len(places) - 3} more" if len(places) > 3 else "")
        value = self.value / SI_FACTORS[column.unit]
        return (
            f"{column.name} stands at the end of its sensor's range, {value:.6g} {column.unit}: "
            f"{shown}; there it counts as not measured"
        )


def ends(trials: Sequence[Trial]) -> list[End]:
    """Sensors of some trials of one rig that stand at an end of their range.

    Args:
        trials: the trials.
    Returns:
        The ends, in the order of the columns, the upper one of a sensor first.
    """
    limits = []
    for quantity in MEASUREMENTS:
        for sign in (1.0, -1.0):
            end = _daq_end(trials, quantity, sign) or _end(trials, quantity, sign)
            if end is not None:
                limits.append(end)
    return limits


def without(trials: Sequence[Trial], clipped: Sequence[End]) -> list[Trial]:
    """The trials, with what their sensors read at an end of their range not measured."""
    kept = list(trials)
    for end in clipped:
        for number, rows in end.rows.items():
            trial = kept[number]
            values = np.where(rows, np.nan, trial.measurements[end.quantity])
            kept[number] = replace(trial, measurements={**trial.measurements, end.quantity: values})
    return kept


def _daq_end(trials: Sequence[Trial], quantity: str, sign: float) -> End | None:
    """One end of the DAQ's range, for readings that keep to its levels."""
    rows, value = {}, 0.0
    for number, trial in enumerate(trials):
        row = trial.measurements.get(quantity, np.empty(0))
        at = at_daq_end(SIGNALS[quantity], row) & (sign * row > 0.0)
        if at.any():
            rows[number], value = at, float(row[at][0])
    return End(quantity, value, rows) if rows else None


def _end(trials: Sequence[Trial], quantity: str, sign: float) -> End | None:
    """One end of a sensor's range; None where no trial comes there."""
    series = {
        number: sign * trial.measurements[quantity]
        for number, trial in enumerate(trials)
        if quantity in trial.measurements and np.isfinite(trial.measurements[quantity]).any()
    }
    if not series:
        return None
    readings = np.unique(np.concatenate([row[np.isfinite(row)] for row in series.values()]))
    if len(readings) < LEAST_ROWS:
        return None
    largest, step = float(readings[-1]), float(np.median(np.diff(readings)))
    tolerance = 1e-6 * max(step, 1e-12)
    at = {number: np.abs(row - largest) <= tolerance for number, row in series.items()}
    elsewhere = max(_longest(row, ~at[number]) for number, row in series.items())
    least = max(LEAST_ROWS, TIMES * elsewhere)
    shown = any(
        stop - start >= least
        and _moves(trials[number], start, stop)
        and _jumps(series[number], start, stop, step)
        for number, there in at.items()
        for start, stop in runs(there)
    )
    if not shown:
        return None
    rows = {number: _closed(there) for number, there in at.items() if there.any()}
    return End(quantity, sign * largest, rows)


def runs(there: Rows) -> Iterator[tuple[int, int]]:
    """Beginning and end (one past the last) of every run of true rows."""
    edges = np.flatnonzero(np.diff(np.r_[0, there.astype(np.int8), 0]))
    yield from (
        (int(start), int(stop)) for start, stop in zip(edges[::2], edges[1::2], strict=True)
    )


def _longest(row: Array, counted: Rows) -> int:
    """Length of the longest run of equal readings among those that count."""
    equal = (np.diff(row) == 0.0) & counted[1:] & counted[:-1]
    return 1 + max((stop - start for start, stop in runs(equal)), default=0)


def _moves(trial: Trial, start: int, stop: int) -> bool:
    """Test whether a command moves in most of the rows: a sensor at rest is not clipped."""
    changes = [np.diff(np.nan_to_num(row[start:stop])) != 0.0 for row in trial.commands.values()]
    return any(2 * moved.sum() > moved.size for moved in changes)


def _jumps(row: Array, start: int, stop: int, step: float) -> bool:
    """Test whether the readings before or after extrapolate beyond the end."""
    for part in (row[max(0, start - BEFORE) : start], row[stop : stop + BEFORE][::-1]):
        if len(part) == BEFORE and np.isfinite(part).all():
            slope = float(np.polyfit(np.arange(BEFORE), part, 1)[0])
            if slope * min(stop - start, BEFORE) > JUMP * step:
                return True
    return False


def _closed(there: Rows) -> Rows:
    """The rows, with short gaps between them."""
    closed = there.copy()
    stretches = list(runs(there))
    for (_, stop), (start, _) in zip(stretches, stretches[1:], strict=False):
        if start - stop <= NEAR:
            closed[stop:start] = True
    return closed
