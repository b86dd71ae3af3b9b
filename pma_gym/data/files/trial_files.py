"""Trials in files: one file a trial, columns by name and unit, SI inside.

A value in file units is a double; its text is the shortest that names it. What was read from a file
is written and read again bit for bit. What comes from a computation in m, rad and Pa goes through
mm, deg and kPa, where not every double has a counterpart: writing it and reading it back gives the
same bits or, for one value in fifty (one in ten for angles), a neighbour (1 ulp). XLSX keeps 16
digits of the value in file units: within 4 ulp.
"""

import os
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.files.even_clock import even_clock, joined
from pma_gym.data.files.trial_formats import ENCODERS
from pma_gym.data.files.trial_hints import looks_like, mapping_line
from pma_gym.data.files.trial_loading import known_suffix, load_table
from pma_gym.data.files.trial_values import TrialWarning, check_units, file_values, warn
from pma_gym.data.readers.table import FileFormat, Table, UnreadableError, decimal_mark, shown
from pma_gym.data.trial import Trial
from pma_gym.data.trial_checks import check_commanded, check_time
from pma_gym.data.trial_columns import (
    COLUMNS,
    ColumnMap,
    Source,
    TrialError,
    sources,
    suggestion,
)
from pma_gym.files import OutputError, as_path, check_output, replace_file

__all__ = [
    "USUAL_S",
    "TrialWarning",
    "check_writable",
    "encode_trial",
    "place_in_file",
    "read_header",
    "read_trial",
    "trial_of",
    "write_trial",
]

USUAL_S = 600.0
"""Longest trial (s) whose time is not doubted; the dissertation's last 15 s."""


def read_trial(
    path: str | os.PathLike[str],
    columns: ColumnMap | None = None,
    form: FileFormat | None = None,
) -> Trial:
    """A trial from a text, Parquet, XLSX, LabVIEW, MAT, HDF5 or TDMS file.

    Columns are matched by name: `time_s`, a command (`motor_voltage_v`, `regulator_voltage_v`,
    `load_command_n`, `pressure_command_kpa`) and any of `contraction_mm`, `rotation_deg`,
    `load_n`, `pressure_kpa`, or a sensor's raw voltage in place of one of these: `lvdt_v`,
    `potentiometer_v`, `load_cell_v`, `pressure_transducer_v`, decoded by table 1 (rotation then
    counts from its first value). An empty cell is not measured: NaN.

    Args:
        path: the file; its suffix tells the format. `march.xlsx#run2` names one of several sheets,
            segments, groups or structures.
        columns: the file's own names to ours, with factor and offset (see `ColumnMap`).
        form: separator, decimal mark, encoding, header, names and marks of missing values, where
            the file leaves them open.
    Returns:
        The trial; its provenance is what the file carries (a CSV file carries none).
    Raises:
        TrialError: the file cannot be used; names file, row, column, rule and fix.
    Warns:
        TrialWarning: what is passed over or converted: unknown columns, titles, footers, repeated
            rows, dates; a time of over ten minutes, which may be no seconds; readings at an end of
            their sensor's range, which are not measured.
    """
    form = form or FileFormat()
    return trial_of(load_table(path, columns, form), columns or {}, form)


def trial_of(table: Table, mapping: ColumnMap, form: FileFormat) -> Trial:
    """The trial in a table; see `read_trial`.

    Args:
        table: what `load_tables` gave.
        mapping: the lab's names of columns to ours.
        form: what the lab says about its files.
    Returns:
        The trial.
    Raises:
        TrialError: names file, row, column, rule and fix.
    """
    known = _match(table, mapping)
    for remark in table.remarks:
        warn(f"{table.file}: {remark}")
    check_units(known, table, mapping)
    mark = form.decimal or decimal_mark(table.cells[source.index] for source in known)
    arrays = {source.column.quantity: file_values(source, table, form, mark) for source in known}
    if (np.diff(arrays["time"]) == 0.0).any() and (clock := even_clock(arrays["time"])) is not None:
        # Rounded so coarsely that stamps repeat: the clock behind them still increases.
        arrays["time"] = clock.time
        warn(f"{table.file}: {clock.words()}")
    check_time(arrays["time"], table.place)
    _doubt_time(arrays["time"], table)
    check_commanded(arrays, table.file)
    if form.interpolation == "foh":
        _join_commands(known, arrays, table)
    inside = {
        source.column.quantity: source.column.to_si(arrays[source.column.quantity])
        for source in known
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
    path = as_path(path, TrialError)
    if not path.is_dir():
        known_suffix(path, ENCODERS)
    try:
        check_output(path)
    except OutputError as error:
        raise TrialError(str(error)) from None


def place_in_file(
    path: str | os.PathLike[str],
    sample: int,
    columns: ColumnMap | None = None,
    form: FileFormat | None = None,
) -> str:
    """Where a sample of a trial stands in the file that it was read from: `row 3 of ramp.csv`."""
    table = load_table(path, columns, form)
    return table.place(min(sample, len(table.rows) - 1))


def read_header(
    path: str | os.PathLike[str],
    columns: ColumnMap | None = None,
    form: FileFormat | None = None,
) -> list[str]:
    """Names of a file's columns, as they stand there."""
    return list(load_table(path, columns, form).header)


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
    check_writable(path)
    replace_file(Path(path), encode_trial(trial, path))


def encode_trial(trial: Trial, path: str | os.PathLike[str]) -> bytes:
    """Encode a trial as `write_trial` writes it to a file of this name."""
    signals = {"time": trial.time, **trial.commands, **trial.measurements}
    columns = {
        column.name: column.from_si(signals[column.quantity])
        for column in COLUMNS
        if column.quantity in signals
    }
    return ENCODERS[known_suffix(Path(path), ENCODERS)](columns, trial.provenance)


def _match(table: Table, mapping: ColumnMap) -> list[Source]:
    """The columns that are known; warns of the others."""
    named = [name for name in table.header if name]
    counted = Counter(named)
    twice = sorted(name for name, count in counted.items() if count > 1)
    if twice:
        raise TrialError(f"{table.file} has the column {twice[0]!r} twice; rename or remove one")
    matched, unknown = sources(table.header, mapping, table.file)
    strange = [f"{shown(name)}{suggestion(name)}" for name in unknown.values() if name]
    strange += [f"column {index + 1}, which has no name" for index, n in unknown.items() if not n]
    strange = _few(strange)
    absent = [f"{shown(name)}{suggestion(name, named)}" for name in mapping if name not in counted]
    if not any(source.column.quantity == "time" for source in matched):
        kind = TrialError if len(named) > 1 else UnreadableError
        raise kind(
            f"{table.file} has no column time_s; its columns are "
            f"{', '.join(strange or _few(named))}; rename one, or map it in [columns]"
            f"{_time_hint(unknown.values())}"
        )
    if strange:
        warn(f"{table.file}: unknown columns are ignored: {', '.join(strange)}")
    if absent:
        warn(f"{table.file} lacks columns that [columns] maps: {', '.join(absent)}")
    return matched


def _join_commands(
    known: list[Source], arrays: dict[str, NDArray[np.float64]], table: Table
) -> None:
    """Fill the empty cells of commands by lines, with a warning."""
    for source in known:
        values = arrays[source.column.quantity]
        if source.column.kind == "command" and np.isnan(values).any():
            arrays[source.column.quantity] = filled = joined(values, arrays["time"])
            warn(
                f"{table.file}: {source.name} is empty in {np.isnan(values).sum()} of "
                f"{values.size} rows, {np.sum(np.isnan(values) & ~np.isnan(filled))} of them are "
                'joined linearly, as interpolation = "foh" under [format] says'
            )


def _time_hint(names: Iterable[str]) -> str:
    """The line of `[columns]` for a column that looks like the time, if one does."""
    for name in names:
        guess = looks_like(name)
        if guess and guess[0].kind == "time":
            return f" of dataset.toml, for example: {mapping_line(name, *guess)}"
    return ""


def _doubt_time(time: NDArray[np.float64], table: Table) -> None:
    """Warn of a trial so long that its time may not be in seconds."""
    span, steps = float(time[-1] - time[0]), time.size - 1
    if span > USUAL_S:
        warn(
            f"{table.file}: time_s spans {span:g} s, {span / steps:.3g} s from row to row on "
            f"average; trials last up to {USUAL_S:g} s as a rule. If the column holds "
            "milliseconds or sample numbers, divide it by 1000 or by the samples per second"
        )


def _few(names: list[str], most: int = 40) -> list[str]:
    """As many names as one reads."""
    return names if len(names) <= most else [*names[:most], f"{len(names) - most} more"]
