"""A lab's statements on its sensors: `[sensors]` of a `dataset.toml`."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pma_gym.data.readers.table import shown
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY, COLUMNS, Column, TrialError, suggestion
from pma_gym.units import SI_FACTORS

MOST_SIZE = 1e9
"""Sizes of signals are smaller, in any unit of the columns."""

_KEYS = ("resolution", "noise", "range")
_EXAMPLE = "contraction_mm = { resolution = 0.00005, noise = 0.0002, range = [0, 300] }"


@dataclass(frozen=True)
class LabSensor:
    """One sensor (SI); None where the lab does not state it.

    Attributes:
        resolution: smallest step between readings.
        noise: standard deviation, rounding included.
        ends: readings there or beyond are not measured.
    """

    resolution: float | None = None
    noise: float | None = None
    ends: tuple[float, float] | None = None


def lab_sensors(tables: Mapping[str, object], place: str) -> dict[str, LabSensor]:
    """The sensors of `[sensors]`, by measurement.

    Args:
        tables: `resolution`, `noise` and `range` by measurement's column, in its unit.
        place: where it stands, for messages.
    Raises:
        TrialError: an unknown measurement or key, or a size that is none.
    """
    known = {column.name: column for column in COLUMNS if column.kind == "measurement"}
    sensors = {}
    for name, table in tables.items():
        if name not in known:
            raise TrialError(
                f"{place} takes {', '.join(known)}, got {shown(name)}{suggestion(name, known)}; "
                "remove or rename it"
            )
        if not isinstance(table, Mapping) or not set(table) <= set(_KEYS):
            raise TrialError(
                f"{name} in {place} must be a table of {', '.join(_KEYS)}, got {shown(table)}; "
                f"write {_EXAMPLE}"
            )
        sensors[known[name].quantity] = _sensor(known[name], table, place)
    return sensors


def _sensor(column: Column, table: Mapping[str, object], place: str) -> LabSensor:
    factor, ends = SI_FACTORS[column.unit], table.get("range")
    sizes = {}
    for key in ("resolution", "noise"):
        size = _number(table[key]) if key in table else None
        if size is not None and not 0.0 < size < MOST_SIZE:
            raise TrialError(
                f"{key} of {column.name} in {place} must be a number in {column.unit}, above 0 and "
                f"below {MOST_SIZE:g}, got {shown(table[key])}; write {_EXAMPLE}"
            )
        sizes[key] = None if size is None else size * factor
    if ends is None:
        return LabSensor(**sizes)
    pair = [_number(each) for each in ends] if isinstance(ends, list) else []
    if len(pair) != 2 or not pair[0] < pair[1]:
        raise TrialError(
            f"range of {column.name} in {place} must be two numbers in {column.unit}, the lowest "
            f"and the highest that the sensor reads, got {shown(ends)}; write {_EXAMPLE}"
        )
    return LabSensor(**sizes, ends=(pair[0] * factor, pair[1] * factor))


def _number(value: object) -> float:
    """A finite number, or NaN."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return math.nan
    return float(value) if abs(value) < MOST_SIZE else math.nan


def without_ends(
    trial: Trial, sensors: Mapping[str, LabSensor], tell: Callable[[str], None]
) -> Trial:
    """A trial less what its sensors read at an end of their range, which says only that it ends.

    Args:
        trial: the trial.
        sensors: by measurement.
        tell: called with words on each signal that loses readings.
    """
    measured = dict(trial.measurements)
    for name, sensor in sensors.items():
        if sensor.ends is None or name not in measured:
            continue
        low, high = sensor.ends
        row, column = measured[name], BY_QUANTITY[name]
        with np.errstate(invalid="ignore"):
            beyond = (row <= low) | (row >= high)
        if beyond.any():
            at, factor = np.flatnonzero(beyond), SI_FACTORS[column.unit]
            tell(
                f"{column.name} is at an end of its range, {low / factor:.6g} to "
                f"{high / factor:.6g} {column.unit}, in {at.size} of {row.size} rows, number "
                f"{at[0] + 1} to {at[-1] + 1}; there it counts as not measured"
            )
            measured[name] = np.where(beyond, np.nan, row)
    return replace(trial, measurements=measured)
