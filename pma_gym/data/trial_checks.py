"""What every trial must obey, said in words that tell where it does not and what to do."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.time_order import Place, time_disorder
from pma_gym.data.trial_columns import BY_QUANTITY, COLUMNS, Column, TrialError

COMMANDS = tuple(column.quantity for column in COLUMNS if column.kind == "command")
"""motor_voltage, regulator_voltage (V); instead of them load_command (N), pressure_command (Pa)."""


def check_commanded(quantities: Iterable[str], owner: str) -> None:
    """Refuse a trial without a command.

    Args:
        quantities: what the trial holds.
        owner: what to call it.
    Raises:
        TrialError: none of them is a command.
    """
    if not set(quantities) & set(COMMANDS):
        names = " or ".join(BY_QUANTITY[quantity].name for quantity in COMMANDS)
        raise TrialError(f"{owner} needs at least one command, {names}; it has none")


def check_memory_at_start(value: object, owner: str) -> None:
    """Refuse where no memory stands as a trial begins.

    Args:
        value: -1 to 1, or None where nobody says.
        owner: what has it.
    Raises:
        TrialError: a value is out of range; the message names the range and the value.
    """
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    # `not <=`: NaN is out of every range.
    if value is not None and not (number and -1.0 <= float(value) <= 1.0):  # type: ignore[arg-type]
        raise TrialError(
            f"memory_at_start of {owner} must be a number in -1 to 1, got {value!r}; write 1 where "
            "the muscle was filled and has contracted, -1 where it was stretched before, 0 where "
            "it stood in between, or leave it out"
        )


_ROUNDING = 1e-6
"""Share by which a step in floating point may fall short."""

LONGEST_S = 86_400.0
"""Longest trial (s): a day, two minutes of simulation."""

SHORTEST_STEP_S = 1e-6
"""Shortest time between samples, on average (s); two rows may be closer, for a jump."""


def check_time(time: NDArray[np.float64], place: Place) -> None:
    """Refuse times (s) that are not finite, do not strictly increase or are no seconds.

    Raises:
        TrialError: says where, and both times.
    """
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        value = "none" if np.isnan(time[bad[0]]) else f"{time[bad[0]]}"
        raise TrialError(
            f"time_s must be a finite number of seconds, {place(int(bad[0]))} has {value}; "
            "fill it in or remove the row"
        )
    disorder = time_disorder(time, place)
    if disorder:
        raise TrialError(f"time_s must increase strictly, {disorder}")
    steps, span = time.size - 1, float(time[-1] - time[0])
    ends = f"from {place(0)} to {place(steps)} it is"
    if span > LONGEST_S:
        raise TrialError(
            f"time_s must span {LONGEST_S:g} s (a day) at most, {ends} {span:g} s; write seconds: "
            "divide milliseconds by 1000, and sample numbers by the samples per second"
        )
    if steps and span < SHORTEST_STEP_S * (1.0 - _ROUNDING) * steps:
        raise TrialError(
            f"samples must lie {SHORTEST_STEP_S:g} s or more apart in time_s, {ends} "
            f"{span / steps:.3g} s on average; write seconds: multiply hours by 3600, and a "
            "spreadsheet's days by 86400"
        )


def check_values(
    name: str, values: NDArray[np.float64], column: Column | None, place: Place, fix: str
) -> None:
    """Refuse infinity, and values outside the limits of their column.

    Args:
        name: what to call the values.
        values: in the unit of the limits; NaN = not measured.
        column: whose limits hold; None for no limits.
        place: where a sample stands.
        fix: what to do about a value outside the limits.
    Raises:
        TrialError: names the value, the limits, the unit and the place.
    """
    bad = np.flatnonzero(np.isinf(values))
    if bad.size:
        raise TrialError(
            f"{name} must be finite, {place(int(bad[0]))} has {values[bad[0]]}; "
            "leave empty (NaN) what was not measured"
        )
    if column is None or column.limits is None:
        return
    low, high = column.limits
    bad = np.flatnonzero((values < low) | (values > high))
    if bad.size:
        limits = f"{low:g}-{high:g}" if low >= 0 else f"{low:g} to {high:g}"
        raise TrialError(
            f"{name} must lie in {limits} {column.unit}, {place(int(bad[0]))} has "
            f"{float(values[bad[0]])!r}; {fix}"
        )
