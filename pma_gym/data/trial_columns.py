"""The columns of a trial's file: name and unit in files, kind and name inside."""

import difflib
import reprlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.calibration import DAQ_LIMIT, DAQ_STEP, Calibration
from pma_gym.data.signals import SIGNALS, VOLTAGE_RANGE, Signal
from pma_gym.units import SI_FACTORS

__all__ = ["VOLTAGE_RANGE", "Column", "ColumnMap", "SampleError", "Source", "TrialError"]

ColumnMap = Mapping[str, str | Mapping[str, object]]
"""A lab's own column names to ours: `{"Weg": "contraction_mm"}`, or with a linear conversion,
`{"Weg": {"name": "contraction_mm", "factor": -1.0, "offset": 60.0}}`: ours = factor * theirs +
offset, in the unit of our column. `range`, two numbers in that unit, says where the sensor ends:
readings there or beyond are not measured. `limit`, two numbers too, says what a drive takes of a
command: values beyond are clipped. It is what `[columns]` of a `dataset.toml` holds."""


class TrialError(ValueError):
    """A trial, or its file, that cannot be used; the message says where, why and the mend."""


class SampleError(TrialError):
    """A trial of which one sample cannot be used.

    Attributes:
        sample: its index.
    """

    def __init__(self, template: str, sample: int) -> None:
        """Take the message, in which `{place}` stands for where the sample is."""
        self._template = template
        self.sample = sample
        super().__init__(self.at(f"sample {sample}"))

    def at(self, place: str) -> str:
        """The message, with another name of the place: `row 3 of ramp.csv`."""
        return self._template.replace("{place}", place)

    def __reduce__(self) -> tuple[type["SampleError"], tuple[object, ...]]:
        """Send to other processes by construction."""
        return SampleError, (self._template, self.sample)


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        name: in files, with unit.
        unit: in files.
        kind: "time", "command" or "measurement".
        quantity: what a `Trial` calls it; in SI there.
        limits: smallest and largest value in file units, where there are any.
        calibration: for a sensor's raw voltage, the line that decodes it.
        starts_at_zero: a trial counts raw voltages from its own first reading.
    """

    name: str
    unit: str
    kind: str
    quantity: str
    limits: tuple[float, float] | None = None
    calibration: Calibration | None = None
    starts_at_zero: bool = False

    @classmethod
    def of(cls, signal: Signal) -> "Column":
        """The column of a signal."""
        return cls(signal.column, signal.unit, signal.kind, signal.name, signal.limits)

    @classmethod
    def raw(cls, signal: Signal) -> "Column":
        """The column of the raw voltage of a signal's sensor."""
        line, zero = signal.calibration, signal.starts_at_zero
        return cls(signal.raw_column, "V", signal.kind, signal.name, _DAQ_RANGE, line, zero)

    def to_si(self, file_key: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values in SI of values in file units."""
        if self.calibration is None:
            return file_key * SI_FACTORS[self.unit]
        values = self.calibration.from_volts(file_key)
        # A potentiometer's zero is its protractor's; a trial's rotation starts at 0.
        return values - _first_measured(values) if self.starts_at_zero else values

    def from_si(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values in file units that `to_si` takes back to the same bits, where such values exist.

        The one with fewest digits is chosen, so that 25.3 mm is written 25.3; where no double
        in file units stands for exactly this one in SI, the result reads back 1 ulp off.
        """
        nearest = values / SI_FACTORS[self.unit]
        chosen = nearest.copy()
        neighbours = (np.nextafter(nearest, -np.inf), np.nextafter(nearest, np.inf), nearest)
        # Later candidates overwrite earlier ones: the shortest comes last.
        for candidate in (*neighbours, _rounded(nearest, 16), _rounded(nearest, 15)):
            exact = self.to_si(candidate) == values
            chosen[exact] = candidate[exact]
        return chosen


_DAQ_RANGE = (-DAQ_LIMIT, DAQ_LIMIT)

_IN_FILES = tuple(signal for signal in SIGNALS.values() if signal.kind != "derived")

COLUMNS: tuple[Column, ...] = (
    Column("time_s", "s", "time", "time"),
    *(Column.of(signal) for signal in _IN_FILES),
)
"""What files hold, in the order in which they are written."""

RAW_COLUMNS: tuple[Column, ...] = tuple(
    Column.raw(signal) for signal in _IN_FILES if signal.raw_column
)
"""Raw sensor volts, which a file may hold instead; decoded on reading, never written."""

OTHER_UNITS: tuple[Column, ...] = tuple(
    Column.of(replace(signal, unit=unit)) for signal in _IN_FILES for unit in signal.other_units
)
"""The same signals in other units, which a file may hold instead; never written."""

BY_NAME = {column.name: column for column in (*COLUMNS, *RAW_COLUMNS, *OTHER_UNITS)}
BY_QUANTITY = {column.quantity: column for column in COLUMNS}


@dataclass(frozen=True)
class Source:
    """Where in a file a column comes from.

    Attributes:
        index: position in the file.
        name: the file's own name of it.
        column: what it is.
        factor: ours = factor * theirs + offset.
        offset: see factor; in the unit of our column.
        ends: where its sensor ends, in the unit of our column: readings there or beyond are not
            measured; None where that is not known.
        limit: what a drive takes of a command, in the unit of our column: values beyond are
            clipped; None for no limit.
    """

    index: int
    name: str
    column: Column
    factor: float = 1.0
    offset: float = 0.0
    ends: tuple[float, float] | None = None
    limit: tuple[float, float] | None = None


def sources(
    header: Iterable[str], mapping: ColumnMap, file: str
) -> tuple[list[Source], dict[int, str]]:
    """Which of a file's columns hold what.

    Args:
        header: names of the file's columns.
        mapping: the lab's names to ours.
        file: the file's name, for messages.
    Returns:
        Sources of the columns that are known, and the names of the others by position.
    Raises:
        TrialError: the mapping is malformed, or two columns hold the same quantity.
    """
    known: dict[str, Source] = {}
    unknown: dict[int, str] = {}
    for index, name in enumerate(header):
        source = _source(index, name, mapping)
        if source is None:
            unknown[index] = name
            continue
        rival = known.setdefault(source.column.quantity, source)
        if rival is not source:
            raise TrialError(
                f"{file} has {source.column.quantity} twice, in columns {rival.name!r} and "
                f"{name!r}; remove or rename one"
            )
    return list(known.values()), unknown


def suggestion(name: str, known: Iterable[str] = BY_NAME) -> str:
    """` (did you mean 'time_s'?)` for a name close to a known one, else nothing."""
    lowered = {entry.lower(): entry for entry in known}
    # Ratios of names take time that grows with their lengths.
    close = difflib.get_close_matches(name.strip().lower()[:80], lowered, n=1, cutoff=0.7)
    return f" (did you mean {lowered[close[0]]!r}?)" if close else ""


def _source(index: int, name: str, mapping: ColumnMap) -> Source | None:
    """The source that one header names; None for an unknown one."""
    if name not in mapping:
        column = BY_NAME.get(name)
        return None if column is None else Source(index, name, column, ends=_daq_ends(column))
    entry = mapping[name]
    entry = {"name": entry} if isinstance(entry, str) else entry
    if not isinstance(entry, Mapping):
        raise TrialError(
            f"[columns] {name!r} must be the name of our column, or a table of {_ENTRIES}, got "
            f'{reprlib.repr(entry)}; write {name!r} = "contraction_mm"'
        )
    extra = set(entry) - {"name", "factor", "offset", *_PAIRS}
    if extra:
        raise TrialError(f"[columns] {name!r} takes {_ENTRIES}, got {sorted(extra)[0]!r}")
    ours = entry.get("name", name)
    if not isinstance(ours, str) or ours not in BY_NAME:
        raise TrialError(
            f"[columns] {name!r} must name one of {', '.join(BY_NAME)}, "
            f"got {reprlib.repr(ours)}{suggestion(ours) if isinstance(ours, str) else ''}"
        )
    factor, offset = (
        _number(f"[columns] {name!r} {key}", entry.get(key, usual))
        for key, usual in (("factor", 1.0), ("offset", 0.0))
    )
    if factor == 0.0:
        raise TrialError(f"[columns] {name!r} factor must not be 0, or every value is the same")
    column = BY_NAME[ours]
    ends, limit = (_pair(name, column, key, entry.get(key)) for key in _PAIRS)
    return Source(index, name, column, factor, offset, ends or _daq_ends(column), limit)


_ENTRIES = "name, factor, offset, range and limit"
_PAIRS = {
    "range": ("measurement", "where a sensor ends", "the sensor reads"),
    "limit": ("command", "what a drive takes", "the drive takes"),
}
"""Entries of two numbers: of which kind of column, what they are, and who sets them."""


def _pair(name: str, column: Column, key: str, entry: object) -> tuple[float, float] | None:
    """Least and largest value of a mapped column, for its sensor or its drive."""
    kind, what, whose = _PAIRS[key]
    if entry is None:
        return None
    if column.kind != kind:
        raise TrialError(
            f"[columns] {name!r} has a {key}, but {column.name} is no {kind}; remove {key}: it is "
            f"{what}"
        )
    if not isinstance(entry, list | tuple) or len(entry) != 2:
        raise TrialError(
            f"[columns] {name!r} {key} must be two numbers in {column.unit}, the lowest and the "
            f"highest that {whose}, got {reprlib.repr(entry)}; write {key} = [0, 50]"
        )
    low, high = (_number(f"[columns] {name!r} {key}", value) for value in entry)
    if low >= high:
        raise TrialError(f"[columns] {name!r} {key} must grow, the lowest first, got {entry!r}")
    return low, high


def _daq_ends(column: Column) -> tuple[float, float] | None:
    """Where the DAQ ends, for raw volts: its first and last levels."""
    if column.calibration is None:
        return None
    last = DAQ_LIMIT - 1.5 * DAQ_STEP
    return -last, last


def _number(name: str, value: object) -> float:
    """A finite number of a mapping."""
    # A whole number beyond the doubles fits in none.
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < 1e308:
        raise TrialError(
            f"{name} must be a finite number, got {reprlib.repr(value)}; write a number like 0.1"
        )
    return float(value)


def _rounded(values: NDArray[np.float64], digits: int) -> NDArray[np.float64]:
    """Values rounded to a number of significant decimal digits."""
    return np.array([float(f"{value:.{digits}g}") for value in values.tolist()])


def _first_measured(values: NDArray[np.float64]) -> float:
    """The first value that is no gap; 0 if all are."""
    measured = values[~np.isnan(values)]
    return float(measured[0]) if measured.size else 0.0
