"""Trials in files: one file a trial, columns by name and unit, SI inside.

A value at the door is a double; its text is the shortest that names it. What was read from a file
is written and read again bit for bit. What comes from a computation in m, rad and Pa goes through
mm, deg and kPa, where not every double has a counterpart: writing it and reading it back gives the
same bits or, for one value in fifty (one in ten for angles), a neighbour (1 ulp). XLSX keeps 16
digits of the value at the door: within 4 ulp.
"""

import os
import re
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.data.trial_checks import check_commanded, check_time, check_values
from pma_gym.data.trial_columns import (
    COLUMNS,
    ColumnMap,
    Source,
    TrialError,
    sources,
    suggestion,
)
from pma_gym.data.trial_formats import DECODERS, ENCODERS, Table
from pma_gym.files import OutputError, check_output, replace_file

_NEEDED = "a trial needs a header with time_s and a command, and a row for each sample"
USUAL_S = 600.0
"""Longest trial (s) whose time is not doubted; the dissertation's last 15 s."""

_COUNTS = "if the log is in raw DAQ counts, give [columns] a factor"


class TrialWarning(UserWarning):
    """Something in a trial's file was passed over; the message says what."""


def read_trial(path: str | os.PathLike[str], columns: ColumnMap | None = None) -> Trial:
    """A trial from a CSV, Parquet or XLSX file.

    Columns are matched by name: `time_s`, a command (`motor_voltage_v`, `regulator_voltage_v`,
    `load_command_n`, `pressure_command_kpa`) and any of `contraction_mm`, `rotation_deg`,
    `load_n`, `pressure_kpa`, or a sensor's raw voltage in place of one of these: `lvdt_v`,
    `potentiometer_v`, `load_cell_v`, `pressure_transducer_v`, decoded by table 1 (rotation then
    counts from its first value). An empty cell is not measured: NaN.

    Args:
        path: the file; its suffix tells the format.
        columns: the file's own names to ours, with factor and offset (see `ColumnMap`).
    Returns:
        The trial; its provenance is what the file carries (a CSV file carries none).
    Raises:
        TrialError: the file cannot be used; names file, row, column, rule and mend.
    Warns:
        TrialWarning: unknown columns, which are passed over; a time of over ten minutes, which may
            be no seconds; readings at an end of their sensor's range, which are not measured.
    """
    path = Path(path)
    table = _load(path)
    mapping = columns or {}
    found = _match(table, mapping)
    arrays = {source.column.quantity: _door_values(source, table) for source in found}
    check_time(arrays["time"], table.place)
    _doubt_time(arrays["time"], table)
    check_commanded(arrays, table.file)
    inside = {
        source.column.quantity: source.column.to_si(arrays[source.column.quantity])
        for source in found
    }
    kinds: dict[str, dict[str, NDArray[np.float64]]] = {"command": {}, "measurement": {}}
    for column in COLUMNS[1:]:
        if column.quantity in inside:
            kinds[column.kind][column.quantity] = inside[column.quantity]
    return Trial(
        time=inside["time"],
        commands=kinds["command"],
        measurements=kinds["measurement"],
        provenance=table.provenance,
    )


def check_writable(path: str | os.PathLike[str]) -> None:
    """Refuse a file that `write_trial` could not write, before there is a trial.

    Raises:
        TrialError: unknown suffix, a folder, no such folder, or no leave to write.
    """
    path = Path(path)
    if not path.is_dir():
        _suffix(path)
    try:
        check_output(path)
    except OutputError as error:
        raise TrialError(str(error)) from None


def place_in_file(path: str | os.PathLike[str], sample: int) -> str:
    """Where a sample of a trial stands in the file that it was read from: `row 3 of ramp.csv`."""
    return _load(Path(path)).place(sample)


def read_header(path: str | os.PathLike[str]) -> list[str]:
    """Names of a file's columns, as they stand there."""
    return list(_load(Path(path)).header)


def write_trial(trial: Trial, path: str | os.PathLike[str]) -> None:
    """Write a trial as the station's log would be: time, commands and measurements.

    Truth is not written, for no log has it. Provenance goes into Parquet's metadata and XLSX's
    second sheet; CSV has no place for it. The file appears whole or not at all. The same trial
    gives the same bytes in CSV and Parquet; XLSX stamps the time of writing.

    Args:
        trial: what to write.
        path: a name that ends in .csv, .parquet or .xlsx; replaced if it exists.
    Raises:
        TrialError: unknown suffix, no such folder, no leave to write, or a library of
            `pma-gym[files]` is missing.
        OSError: the disk refuses.
    """
    path = Path(path)
    check_writable(path)
    replace_file(path, encode_trial(trial, path))


def encode_trial(trial: Trial, path: str | os.PathLike[str]) -> bytes:
    """What `write_trial` writes to a file of this name."""
    held = {"time": trial.time, **trial.commands, **trial.measurements}
    columns = {
        column.name: column.from_si(held[column.quantity])
        for column in COLUMNS
        if column.quantity in held
    }
    return ENCODERS[_suffix(Path(path))](columns, trial.provenance)


def _load(path: Path) -> Table:
    """The file's table, which has a header and a row."""
    if path.is_dir():
        raise TrialError(f"{path} is a folder; name a {' or '.join(DECODERS)} file in it")
    decode = DECODERS[_suffix(path)]
    if not path.is_file():
        raise TrialError(f"there is no file {path}; check the name and the folder")
    content = path.read_bytes()
    table = decode(content, path.name) if content else Table(path.name, [], [], [])
    if not table.header:
        raise TrialError(f"{path.name} is empty; {_NEEDED}")
    if not table.rows:
        raise TrialError(f"{path.name} has a header but no rows; {_NEEDED}")
    return table


def _suffix(path: Path) -> str:
    """The suffix in lower case, if there is a format for it."""
    suffix = path.suffix.lower()
    if suffix not in DECODERS:
        raise TrialError(
            f"{path.name} must end in {', '.join(DECODERS)}, got {path.suffix or 'no suffix'!r}; "
            "save it in one of these formats"
        )
    return suffix


def _match(table: Table, mapping: ColumnMap) -> list[Source]:
    """The columns that are known; warns of the others."""
    named = [name for name in table.header if name]
    twice = sorted({name for name in named if named.count(name) > 1})
    if twice:
        raise TrialError(f"{table.file} has the column {twice[0]!r} twice; rename or remove one")
    found, unknown = sources(table.header, mapping, table.file)
    strange = [f"{name!r}{suggestion(name)}" for name in unknown.values() if name]
    absent = [f"{name!r}{suggestion(name, named)}" for name in mapping if name not in named]
    if not any(source.column.quantity == "time" for source in found):
        raise TrialError(
            f"{table.file} has no column time_s; its columns are "
            f"{', '.join(strange or named)}; rename one, or map it in [columns]"
        )
    if strange:
        _warn(f"{table.file}: unknown columns are ignored: {', '.join(strange)}")
    if absent:
        _warn(f"{table.file} lacks columns that [columns] maps: {', '.join(absent)}")
    return found


def _doubt_time(time: NDArray[np.float64], table: Table) -> None:
    """Warn of a trial so long that its time may not be in seconds."""
    span, steps = float(time[-1] - time[0]), time.size - 1
    if span > USUAL_S:
        _warn(
            f"{table.file}: time_s spans {span:g} s, {span / steps:.3g} s from row to row on "
            f"average; trials last up to {USUAL_S:g} s as a rule. If the column holds "
            "milliseconds or sample numbers, divide it by 1000 or by the samples per second"
        )


def _warn(message: str) -> None:
    """Warn at the line that called `read_trial`."""
    warnings.warn(message, TrialWarning, stacklevel=4)


def _door_values(source: Source, table: Table) -> NDArray[np.float64]:
    """A column's values in its unit at the door, mapped and checked; NaN where a cell is empty."""
    theirs = np.empty(len(table.rows))
    for index, cell in enumerate(table.cells[source.index]):
        number = _number(cell)
        if number is None:
            raise TrialError(
                f"{source.name} must hold numbers, {table.place(index)} has {cell!r}; "
                f"{_mend(source, cell)}"
            )
        theirs[index] = number
    values = source.factor * theirs + source.offset
    if source.column.kind != "time":
        check_values(source.column.name, values, source.column, table.place, _COUNTS)
    return values if source.ends is None else _within(values, source, table)


def _within(values: NDArray[np.float64], source: Source, table: Table) -> NDArray[np.float64]:
    """Values less those at an end of their sensor's range, which say only that it ends there."""
    assert source.ends is not None
    low, high = source.ends
    with np.errstate(invalid="ignore"):
        beyond = (values <= low) | (values >= high)
    at = np.flatnonzero(beyond)
    if not at.size:
        return values
    first, last = table.rows[int(at[0])], table.rows[int(at[-1])]
    name = f"{source.name!r} ({source.column.name})" if source.name != source.column.name else ""
    _warn(
        f"{table.file}: {name or source.name} is at an end of its range, {low:.6g} to {high:.6g} "
        f"{source.column.unit}, in {at.size} of {values.size} rows, row {first} to row {last}; "
        "there it counts as not measured"
    )
    return np.where(beyond, np.nan, values)


def _number(cell: object) -> float | None:
    """The cell's number, NaN for an empty cell, None for anything else."""
    if cell is None:
        return np.nan
    if isinstance(cell, int | float) and not isinstance(cell, bool):
        return float(cell)
    # Python's float also takes 1_000, which no log means.
    if not isinstance(cell, str) or "_" in cell:
        return None
    try:
        return float(cell) if cell.strip() else np.nan
    except ValueError:
        return None


def _mend(source: Source, cell: object) -> str:
    """What to do about a cell that is no number."""
    if isinstance(cell, str) and re.fullmatch(r"\s*[+-]?\d+,\d+\s*", cell):
        return "write it with a decimal point"
    if source.column.kind == "time":
        return "give seconds since the start of the trial"
    return "leave the cell empty where nothing was measured"
