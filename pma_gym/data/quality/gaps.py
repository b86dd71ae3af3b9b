"""Gaps in a log: rows that are missing, commands that were not written; the pieces between them.

Commands are joined from row to row. Across a gap that joins what nobody knows: the rig may have
been anywhere, and the model is led astray.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY

Array = NDArray[np.float64]

LONGEST_S = 0.2
"""Longest time (s) between two rows, or two values of a command, that is no gap."""

TIMES = 5.0
"""How many times as long as the usual step a gap is at least."""

REGULAR = 0.9
"""Share of a command's values, equally many rows apart, from which a slower writer gives it."""

LEAST_S, LEAST_ROWS = 0.5, 20
"""Shortest piece that is kept (s), and its fewest rows."""


@dataclass(frozen=True)
class Gap:
    """A gap of a trial.

    Attributes:
        last: index of the last row before it.
        first: index of the first row after it.
        since, until: their times (s).
        rows: how many rows are missing or without a command.
        command: the column that has no value there; empty where whole rows are missing.
    """

    last: int
    first: int
    since: float
    until: float
    rows: int
    command: str = ""

    def words(self) -> str:
        """Text of the warning: what is missing, from when to when, and how much."""
        span = f"from {self.since:.4g} to {self.until:.4g} s ({self.until - self.since:.3g} s"
        if self.command:
            return f"{self.command} has no value in {self.rows} rows {span})"
        return f"about {self.rows} rows are missing {span})"


def gaps(trial: Trial) -> list[Gap]:
    """Gaps of a trial, in the order of time; those that overlap count once.

    Where a command stands at the same value before and after empty cells, it was held: no gap.
    """
    steps = np.diff(trial.time)
    if steps.size < 2:
        return []
    usual = float(np.median(steps))
    limit = max(LONGEST_S, TIMES * usual)
    missing = [
        Gap(
            int(at),
            int(at) + 1,
            *(float(trial.time[at]), float(trial.time[at + 1])),
            rows=max(1, round(float(steps[at]) / usual) - 1),
        )
        for at in np.flatnonzero(steps > limit)
    ]
    for name, values in trial.commands.items():
        missing += _without_command(BY_QUANTITY[name].name, values, trial.time, limit)
    kept: list[Gap] = []
    for gap in sorted(missing, key=lambda each: each.last):
        if not kept or gap.last >= kept[-1].first:
            kept.append(gap)
    return kept


def _without_command(name: str, values: Array, time: Array, limit: float) -> Iterator[Gap]:
    """Where a command that rows give regularly is not given for long, and changes meanwhile."""
    known = np.flatnonzero(np.isfinite(values))
    apart = np.diff(known)
    usual = np.median(apart) if apart.size else 0.0
    if 2 * known.size <= values.size and np.mean(apart == usual) < REGULAR:
        return
    limit = max(limit, TIMES * float(np.median(np.diff(time[known]))))
    span = float(np.ptp(values[known]))
    for last, first in zip(known, known[1:], strict=False):
        if first - last < 2 or time[first] - time[last] <= limit:
            continue
        around = values[max(0, last - 3) : first + 4]
        # A command that stood still before, after and in between was held.
        if float(np.nanmax(around) - np.nanmin(around)) <= 1e-3 * span:
            continue
        since, until = float(time[last]), float(time[first])
        yield Gap(int(last), int(first), since, until, int(first - last) - 1, name)


def pieces(trial: Trial, missing: list[Gap]) -> list[Trial]:
    """Return the pieces between gaps, without those too short to be informative."""
    starts = [0, *(gap.first for gap in missing)]
    stops = [*(gap.last + 1 for gap in missing), len(trial)]
    kept = []
    for start, stop in zip(starts, stops, strict=True):
        long = stop > start and trial.time[stop - 1] - trial.time[start] >= LEAST_S
        if long and stop - start >= LEAST_ROWS:
            kept.append(rows_of(trial, slice(start, stop)))
    return kept


def rows_of(trial: Trial, rows: slice | NDArray[np.int64]) -> Trial:
    """A trial of some rows of another, without its truth."""
    return Trial(
        trial.time[rows],
        {name: values[rows] for name, values in trial.commands.items()},
        {name: values[rows] for name, values in trial.measurements.items()},
        provenance=trial.provenance,
        # Known at the trial's first sample only.
        memory_at_start=trial.memory_at_start if trial.time[rows][0] == trial.time[0] else None,
    )
