"""The voltage profiles of tables I4-I20, recomputed: `python -m benchmarks profiles --out FILE`."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

from benchmarks.files import write_text
from pma_gym.data.serres2008 import load_table
from pma_gym.studies.recursion import PROFILES
from pma_gym.studies.voltage_profile import voltage_profile

COLUMNS = (
    "table",
    "task",
    "pressure_kpa",
    "time_s",
    "y_desired_m",
    "x_input_m",
    "motor_voltage_v",
)
"""Columns of the file, those of the shipped tables I4-I20."""

# Decimals of the voltage in print, by table; 5 in the others.
_VOLTAGE_DECIMALS = {"I4": 6, "I5": 6, "I7": 6, "I8": 6, "I9": 6, "I17": 4, "I18": 6, "I20": 6}


def run_profiles(out: Path) -> int:
    """Write the 17 profiles, 842 rows, with the digits of the print.

    Args:
        out: CSV file; written whole or not at all.

    Returns:
        The number of rows.
    """
    rows = [row for table in PROFILES for row in _profile_rows(table)]
    write_csv(out, COLUMNS, rows)
    return len(rows)


def _profile_rows(table: str) -> Iterator[tuple[str, ...]]:
    printed = load_table(table)
    task, pressure = str(printed["task"][0]), float(printed["pressure_kpa"][0])
    decimals = _VOLTAGE_DECIMALS.get(table, 5)
    for time, position, x_input, voltage in zip(*voltage_profile(task, pressure), strict=True):
        yield (
            *(table, task, f"{pressure:g}", f"{time:g}"),
            *(_shortest(position, 4), _spreadsheet(x_input), _shortest(voltage, decimals)),
        )


def _shortest(value: float, decimals: int) -> str:
    """A figure without zeros at its end: 0.0, 0.12."""
    return str(round(float(value), decimals))


def _spreadsheet(value: float) -> str:
    """A figure in the eleven characters of the spreadsheet that the tables come from."""
    if 0.0 < abs(value) < 1e-4:
        return repr(float(f"{value:.5e}"))
    return _shortest(value, 9)


def write_csv(out: Path, columns: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    """Write a CSV file whole or not at all.

    Args:
        out: the file; its folder is made.
        columns: header.
        rows: cells as text.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    write_text(out, text.getvalue())
