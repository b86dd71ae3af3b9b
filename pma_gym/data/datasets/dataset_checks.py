"""Checks of a trial's columns by their values: wrong units, dead sensors, gaps."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.files.trial_hints import mapping_line
from pma_gym.data.quality.lone_readings import check_possible
from pma_gym.data.readers.table import Table
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY, ColumnMap, TrialError
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

_DRIVERS = {
    "contraction": ("motor_voltage", "load_command", "regulator_voltage", "pressure_command"),
    "rotation": ("motor_voltage", "load_command"),
    # The drive holds the load, so pressure hardly moves it: less than a coarse load cell shows.
    "load": ("motor_voltage", "load_command"),
    "pressure": ("regulator_voltage", "pressure_command"),
}
"""Commands that move a measurement; none of a rig that may be of any size."""

_LARGE = {
    "motor_voltage": 0.5,
    "regulator_voltage": 0.3,
    "load_command": 50.0,
    "pressure_command": 30.0,
}
"""Change of a command (V, V, N, kPa) that every sensor resolves many times over."""

_USUAL_N_PER_V, _USUAL_DEG_PER_MM = 98.0, 2.2
_FACTOR = 2.5
"""How far a rig may differ from the dissertation's and still be known by its numbers."""

_LEAST_READINGS = 10


@dataclass(frozen=True)
class _Slip:
    """A column in another unit: which, how it was noticed, what it is likely to be in."""

    quantity: str
    seen: str
    unit: str
    factor: float
    extra: str = ""


def check_signals(table: Table, trial: Trial, columns: ColumnMap) -> None:
    """Refuse a trial whose values cannot be in the columns' units, or with a dead sensor.

    Args:
        table: of its file.
        trial: what was read.
        columns: the lab's names to ours.
    Raises:
        TrialError: names file, column, row, rule and mend.
    """
    # Not Column.from_si, which looks for the exact digits of a file.
    file_key = {
        name: values / SI_FACTORS[BY_QUANTITY[name].unit]
        for name, values in {**trial.commands, **trial.measurements}.items()
    }
    for find in (_contraction, _pressure, _load, _rotation):
        slip = find(file_key)
        if slip:
            raise TrialError(_slip_text(table, slip, file_key[slip.quantity], columns))
    for quantity in ("contraction", "pressure", "pressure_command"):
        # A slide without a muscle goes as far as it likes.
        if not SIGNALS[quantity].shortens or any(name in file_key for name in _MUSCLE):
            check_possible(file_key, quantity, table.place)
    for quantity in trial.measurements:
        _check_alive(table.file, quantity, file_key)


def empty_runs(trial: Trial, table: Table) -> Iterator[str]:
    """Return a message on measurements that are empty in over half of a trial's rows."""
    for quantity, values in trial.measurements.items():
        empty = np.isnan(values)
        if 2 * empty.sum() <= empty.size:
            continue
        name = BY_QUANTITY[quantity].name
        if empty.all():
            yield f"{name} is empty in every row; it counts as not measured"
            continue
        edges = np.flatnonzero(np.diff(np.r_[0, empty, 0]))
        starts, ends = edges[::2], edges[1::2]
        longest = int(np.argmax(ends - starts))
        first, last = table.rows[int(starts[longest])], table.rows[int(ends[longest] - 1)]
        yield (
            f"{name} is empty in {empty.sum()} of {empty.size} rows, the longest gap from row "
            f"{first} to row {last}; there it counts as not measured"
        )


def _span(values: Array | None) -> float:
    """Largest less smallest of what was measured; 0 if nothing was."""
    if values is None or not np.isfinite(values).any():
        return 0.0
    return float(np.nanmax(values) - np.nanmin(values))


_BULK = 0.99
"""Share of the readings that a unit is guessed from: one outlier is no unit."""


def _largest(values: Array | None) -> float:
    """Largest magnitude of the bulk of the readings; 0 if nothing was measured."""
    if values is None or not np.isfinite(values).any():
        return 0.0
    sizes = np.sort(np.abs(values[np.isfinite(values)]))
    # Of few readings all but the largest are the bulk.
    return float(sizes[min(int(np.ceil(_BULK * sizes.size)), max(sizes.size - 1, 1)) - 1])


def _moved(file_key: dict[str, Array], quantity: str) -> str:
    """A command that changes so much that a measurement must follow; empty if none does."""
    drivers = _DRIVERS.get(quantity, ())
    return next((name for name in drivers if _span(file_key.get(name)) >= _LARGE[name]), "")


_MUSCLE = ("regulator_voltage", "pressure_command", "pressure")
"""Of these a log of a muscle has one; a slide without a muscle goes as far as it likes."""


def _contraction(file_key: dict[str, Array]) -> _Slip | None:
    if not any(name in file_key for name in _MUSCLE):
        return None
    largest, command = _largest(file_key.get("contraction")), _moved(file_key, "contraction")
    if largest > 250.0:
        unit, factor = ("micrometres", 1e-3) if largest <= 250e3 else ("raw counts", 0.0)
        seen = f"reaches {largest:g} mm, more than any muscle of this station shortens"
        return _Slip("contraction", seen, unit, factor)
    if command and 1e-3 < largest < 0.3 and _span(file_key["contraction"]) > 0.0:
        seen = f"stays within {largest:.3g} mm of 0 although {_change(file_key, command)}"
        return _Slip("contraction", seen, "metres", 1e3, "or its sensor was not connected")
    return None


def _pressure(file_key: dict[str, Array]) -> _Slip | None:
    measured, wished = (
        _largest(file_key.get("pressure")),
        _largest(file_key.get("pressure_command")),
    )
    volts = _largest(file_key.get("regulator_voltage"))
    for quantity, largest in (("pressure", measured), ("pressure_command", wished)):
        if largest > 5000.0:
            seen = f"reaches {largest:g} kPa, which is {largest / 100:g} bar"
            return _Slip(quantity, seen, "pascals", 1e-3)
    if wished > 50.0 and measured:
        for unit, factor in (("bar", 100.0), ("psi", 6.894757), ("MPa", 1e3)):
            if 0.8 < measured * factor / wished < 1.25:
                seen = f"reaches {measured:.3g} kPa where pressure_command_kpa asks for {wished:g}"
                return _Slip("pressure", seen, unit, factor)
    if measured > 50.0 and 0.8 < wished * 100.0 / measured < 1.25:
        seen = f"asks for {wished:.3g} kPa at most where pressure_kpa reaches {measured:.4g}"
        return _Slip("pressure_command", seen, "bar", 100.0)
    if 0.5 < measured < 10.0 and (volts > 1.0 or 0.5 < wished < 10.0):
        rival = f"regulator_voltage_v reaches {volts:g} V" if volts > 1.0 else "so does its command"
        return _Slip(
            "pressure", f"reaches {measured:.3g} kPa and no more, and {rival}", "bar", 100.0
        )
    return None


def _load(file_key: dict[str, Array]) -> _Slip | None:
    measured = _largest(file_key.get("load"))
    wished = _largest(file_key.get("load_command"))
    asked, asks = wished, "load_command_n asks for"
    if not wished:
        asked, asks = (
            _USUAL_N_PER_V * _largest(file_key.get("motor_voltage")),
            "the motor pulls with",
        )
    if not measured or asked < 50.0:
        return None
    for unit, factor in (("kilonewtons", 1e3), ("millinewtons", 1e-3)):
        if 1 / _FACTOR < measured * factor / asked < _FACTOR:
            return _Slip(
                "load", f"reaches {measured:.3g} N where {asks} about {asked:.3g} N", unit, factor
            )
    return None


def _rotation(file_key: dict[str, Array]) -> _Slip | None:
    angle, shortened = file_key.get("rotation"), file_key.get("contraction")
    if angle is None or shortened is None or _span(shortened) < 5.0 or not _span(angle):
        return None
    both = np.isfinite(angle) & np.isfinite(shortened)
    if both.sum() < _LEAST_READINGS or not _span(angle[both]) or not _span(shortened[both]):
        return None
    # Where the cable hangs slack the angle says nothing of the muscle.
    if abs(np.corrcoef(angle[both], shortened[both])[0, 1]) < 0.9:
        return None
    ratio = _span(angle[both]) / _span(shortened[both])
    for unit, factor in (("radians", 57.29578), ("turns", 360.0)):
        if 1 / _FACTOR < ratio * factor / _USUAL_DEG_PER_MM < _FACTOR:
            seen = (
                f"turns by {_span(angle[both]):.3g} deg while contraction_mm changes by "
                f"{_span(shortened[both]):.3g} mm: the pulley would have a radius of "
                f"{57.29578 / ratio / 1e3:.2g} m"
            )
            return _Slip("rotation", seen, unit, factor)
    return None


def _check_alive(file: str, quantity: str, file_key: dict[str, Array]) -> None:
    """Refuse a measurement that never changes although what drives it does."""
    values = file_key[quantity][np.isfinite(file_key[quantity])]
    command = _moved(file_key, quantity)
    if values.size < _LEAST_READINGS or not command or _span(values) > 0.0:
        return
    name = BY_QUANTITY[quantity].name
    raise TrialError(
        f"{name} of {file} is {values[0]:g} in all {values.size} readings although "
        f"{_change(file_key, command)}; if the sensor was not connected, remove the column"
    )


def _change(file_key: dict[str, Array], command: str) -> str:
    column = BY_QUANTITY[command]
    values = file_key[command]
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return f"{column.name} goes from {low:.4g} to {high:.4g} {column.unit}"


def _slip_text(table: Table, slip: _Slip, values: Array, columns: ColumnMap) -> str:
    """The message on a column in another unit."""
    column = BY_QUANTITY[slip.quantity]
    place = table.place(int(np.nanargmax(np.abs(values))))
    said = f"{column.name} {slip.seen} ({place}); it looks like {slip.unit}"
    if slip.extra:
        said += f", {slip.extra}"
    if not slip.factor:
        return f"{said}: give [columns] of dataset.toml a factor"
    for name in table.header:
        entry = columns.get(name)
        if (entry.get("name", name) if isinstance(entry, dict) else entry) == column.name:
            return f"{said}: multiply factor and offset of {name!r} in [columns] by {slip.factor:g}"
    return f"{said}: write under [columns] of dataset.toml: " + mapping_line(
        column.name, column, slip.factor
    )
