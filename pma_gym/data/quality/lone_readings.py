"""Single readings that stand alone: a sensor's or a logger's slip, which no motion makes.

Such a reading lies far from the curve through its four neighbours, and they lie on it. A step, a
kink or an oscillation moves neighbours as well; what follows a jump of a command within a few rows
is left alone whatever its form. A controller answers a slip with such a jump: of positions and
speeds, which no force moves in the row in which it comes, only what comes after a jump is left
alone.

A few readings far from all others: named by their cells, and no unit is guessed from them.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY, TrialError
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

LEAST_ROWS = 100
"""Fewest readings of a trial in which one stands alone."""

ALONE = 5.0
"""Standard deviations of the distance from the curve through its neighbours that make one stand
alone: of Gaussian noise, one reading in two million does."""

STEPS = 3.0
"""Steps of the readings that it must be as well: a coarse sensor jumps from one to the next."""

SIDE, MISS, UNEVEN = -2.0 / 3.0, 0.2, 0.4
"""Distance of the readings before and after from their curves, which go through the lone one, over
its own; how far their mean may be off, and how much they may differ."""

BESIDE, QUIET, REST = 4, 1.6, 0.1
"""Rows beside one that stands alone which a slip must explain; how many standard deviations it may
leave of them, or which share of itself, where noise has heavy tails: a beat leaves more."""

SPREAD = np.sqrt(1.0 + 34.0 / 36.0)
"""Standard deviations of a reading's distance from its curve, in those of a reading."""

USUAL, USUAL_SQUARE = 0.98, 0.8735
"""Share of distances that is noise for certain, and mean square of that share of normal numbers."""

JUMP, NEAR = 0.2, 3
"""Share of a command's span that makes a change from row to row a jump, and rows beside it."""

MOST = 0.03
"""Largest share of readings that stand alone: more are no slips."""


@dataclass(frozen=True)
class LoneReadings:
    """Readings of one signal that stand alone.

    Attributes:
        quantity: the signal.
        rows: by number of the trial, which.
        least: the smallest distance from its neighbours' curve (SI).
    """

    quantity: str
    rows: Mapping[int, Rows]
    least: float

    def words(self, count: int) -> str:
        """Text of the warning, given the number of all readings."""
        column, number = BY_QUANTITY[self.quantity], sum(int(at.sum()) for at in self.rows.values())
        least = self.least / SI_FACTORS[column.unit]
        many = "readings stand" if number > 1 else "readings stands"
        return (
            f"{column.name}: {number} of {count} {many} alone, {least:.3g} {column.unit} or more "
            "from the curve through the neighbours: outliers, which count as not measured"
        )


def without_lone_readings(trials: Sequence[Trial]) -> tuple[list[Trial], list[str]]:
    """Return the trials without isolated outliers, and a message for each signal with some."""
    kept, messages = list(trials), []
    for quantity in dict.fromkeys(name for trial in trials for name in trial.measurements):
        lone = _lone(trials, quantity)
        if lone is None:
            continue
        total = sum(
            int(np.isfinite(trial.measurements[quantity]).sum())
            for trial in trials
            if quantity in trial.measurements
        )
        messages.append(lone.words(total))
        for number, at in lone.rows.items():
            measured = kept[number].measurements
            row = np.where(at, np.nan, measured[quantity])
            kept[number] = replace(kept[number], measurements={**measured, quantity: row})
    return kept, messages


def _lone(trials: Sequence[Trial], quantity: str) -> LoneReadings | None:
    """A signal's readings that stand alone; None where none does, or too many do."""
    apart = {
        number: _distances(trial.measurements[quantity])
        for number, trial in enumerate(trials)
        if quantity in trial.measurements and len(trial) >= LEAST_ROWS
    }
    known = np.concatenate([each[np.isfinite(each)] for each in apart.values()] or [np.empty(0)])
    if known.size < LEAST_ROWS:
        return None
    noise = float(np.sqrt(np.mean(np.sort(known**2)[: int(USUAL * known.size)]) / USUAL_SQUARE))
    limit = max(ALONE * noise, STEPS * _step(trials, quantity))
    rows = {
        number: _alone(trials[number].measurements[quantity], each, limit, noise / SPREAD)
        for number, each in apart.items()
    }
    moves = SIGNALS[quantity].is_position or SIGNALS[quantity].is_speed
    rows = {number: at & ~_by_jumps(trials[number], moves) for number, at in rows.items()}
    rows = {number: at for number, at in rows.items() if at.any()}
    count = sum(int(at.sum()) for at in rows.values())
    if not limit > 0.0 or not count or count > MOST * known.size:
        return None
    least = min(float(np.abs(apart[number][at]).min()) for number, at in rows.items())
    return LoneReadings(quantity, rows, least)


def _distances(row: Array) -> Array:
    """Distance of each reading from the cubic through two before and two after it; NaN at ends."""
    apart = np.full(row.size, np.nan)
    apart[2:-2] = row[2:-2] - (4.0 * (row[1:-3] + row[3:-1]) - row[:-4] - row[4:]) / 6.0
    return apart


def _step(trials: Sequence[Trial], quantity: str) -> float:
    """Smallest difference of two readings that are one after the other (SI)."""
    moves = [np.abs(np.diff(trial.measurements.get(quantity, np.empty(0)))) for trial in trials]
    joined = np.concatenate(moves)
    return float(np.min(joined[joined > 0.0], initial=np.inf)) if np.any(joined > 0.0) else 0.0


def _alone(row: Array, apart: Array, limit: float, noise: float) -> Rows:
    """Which readings stand alone: a slip explains the rows about each, down to noise."""
    single = _like_slips(apart, limit)
    for at in np.flatnonzero(single):
        about = row[max(0, at - BESIDE) : at + BESIDE + 1]
        whole = about.size == 2 * BESIDE + 1 and bool(np.isfinite(about).all())
        single[at] = whole and _is_slip(about, QUIET * noise)
    return single


def _is_slip(about: Array, most: float) -> bool:
    """Whether a slip of the middle row leaves little (rms), and less than a step does."""
    along = np.arange(-BESIDE, BESIDE + 1.0)
    curve = [np.ones_like(along), along, along**2]

    def left(change: Array) -> tuple[float, float]:
        columns = np.stack([*curve, change], axis=1)
        sizes = np.linalg.lstsq(columns, about, rcond=None)[0]
        return float(np.sum((about - columns @ sizes) ** 2)), float(abs(sizes[-1]))

    slip, size = left((along == 0.0).astype(float))
    steps = [left((along >= edge).astype(float))[0] for edge in (-1.0, 0.0, 1.0, 2.0)]
    return slip < min(steps) and slip < max(most, REST * size) ** 2 * (along.size - 4)


def _like_slips(apart: Array, limit: float) -> Rows:
    """Which readings are as far as a slip, by the readings before and after them too."""
    here = np.nan_to_num(apart)
    before, after = np.r_[0.0, here[:-1]], np.r_[here[1:], 0.0]
    far = np.abs(here) > limit
    share = np.where(far, here, 1.0)
    even = np.abs(after - before) < UNEVEN * np.abs(share)
    like = np.abs((after + before) / (2.0 * share) - SIDE) < MISS
    return far & even & like


def _by_jumps(trial: Trial, moves: bool) -> Rows:
    """Rows beside a jump of a command; of what a force moves, those after it alone."""
    near = np.zeros(len(trial), bool)
    for row in trial.commands.values():
        known = row[np.isfinite(row)]
        if not known.size or not np.ptp(known) > 0.0:
            continue
        jumps = np.flatnonzero(np.abs(np.diff(np.nan_to_num(row))) > JUMP * np.ptp(known))
        for at in jumps:
            near[at + 2 if moves else max(0, at - NEAR) : at + NEAR + 2] = True
    return near


LARGEST = {"contraction": 250.0, "pressure": 5000.0, "pressure_command": 5000.0}
"""Magnitude (mm, kPa, kPa) beyond which no muscle of this kind goes."""

_FEW = 0.01
"""Largest share of readings that are outliers."""
_FAR = 10.0
"""Spans of the others by which an outlier lies outside of them."""
_LEAST = 20
_SHOWN = 5

Values = Mapping[str, NDArray[np.float64]]


def check_possible(values: Values, quantity: str, place: Callable[[int], str]) -> None:
    """Refuse readings that no muscle gives.

    Args:
        values: by quantity, in the unit of files.
        quantity: which of them; others than those of `LARGEST` have no bound.
        place: where a sample stands.
    Raises:
        TrialError: names the cells and the fix.
    """
    if quantity not in values or quantity not in LARGEST:
        return
    beyond = np.flatnonzero(np.abs(values[quantity]) > LARGEST[quantity])
    if not beyond.size:
        return
    column = BY_QUANTITY[quantity]
    raise TrialError(
        f"{column.name} is {values[quantity][beyond[0]]:.6g} {column.unit} in "
        f"{_places(beyond, place)}, beyond the {LARGEST[quantity]:g} {column.unit} that a muscle "
        "reaches, while the other readings are not; empty these cells if nothing was measured there"
    )


def outliers(values: Values, place: Callable[[int], str]) -> Iterator[str]:
    """Words on readings that lie far from all others of their signal."""
    for quantity, all_values in values.items():
        finite = np.flatnonzero(np.isfinite(all_values))
        if finite.size < _LEAST:
            continue
        readings = all_values[finite]
        low, high = np.quantile(readings, [_FEW, 1.0 - _FEW], method="nearest")
        at = finite[np.maximum(low - readings, readings - high) > _FAR * (high - low)]
        if not at.size or high == low or at.size > max(1.0, _FEW * finite.size):
            continue
        # A short pulse is a signal; it lasts longer than a reading.
        if np.any(np.diff(at) == 1):
            continue
        column = BY_QUANTITY[quantity]
        yield (
            f"{column.name} is {all_values[at[0]]:.6g} {column.unit} in {_places(at, place)}, far "
            f"from its other readings, {low:.4g} to {high:.4g}; empty these cells if nothing was "
            "measured there"
        )


def _places(at: NDArray[np.intp], place: Callable[[int], str]) -> str:
    shown = ", ".join(place(int(i)).partition(" of ")[0] for i in at[:_SHOWN])
    return f"{shown} and {at.size - _SHOWN} more" if at.size > _SHOWN else shown
