"""Misprints of the tables: what is printed, what is used instead, and why.

A misprint is corrected where another figure of the dissertation gives the right one. Where the
right figure cannot be recovered the cell becomes NaN: a neighbour's value would be an invented
measurement.

Files of the printed tables, and their rows as printed.
"""

import csv
import functools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from importlib import resources

Row = dict[str, str]

_STATISTICS = ("tables_20_24_26_anova", "tables_20_24_26_anova_ratios")


def _files() -> Iterator[tuple[Iterable[str], tuple[str, ...], str]]:
    """Names of tables, the files that hold their columns, and what they show."""
    yield ["I1"], ("table_I1_static_loading",), "static loading"
    yield ["I2"], ("table_I2_contraction_relaxation",), "contraction and relaxation"
    yield ["I3"], ("table_I3_station_limits",), "limits of the station"
    profiles = [f"I{number}" for number in range(4, 21)]
    yield profiles, ("tables_I4_I20_voltage_profiles",), "voltage profile"
    yield ["2"], ("table_02_parameter_profiles",), "parameters by pressure"
    yield "4 7 9 11 13 15".split(), ("tables_04_15_anova",), "analysis of variance"
    yield "5 8 10 16".split(), ("tables_05_16_estimates",), "estimates"
    yield ["12", "14"], ("tables_12_14_means",), "mean damping"
    yield ["6"], ("table_06_constant_stiffness_limits",), "loads of constant stiffness"
    yield ["17"], ("table_17_station_limits_900n",), "limits at 900 N"
    yield ["18"], ("table_18_position_voltage",), "displacement by voltage"
    yield ["19"], ("table_19_recursion_coefficients",), "coefficients of the recursion"
    yield "20 24 25 26".split(), _STATISTICS, "analysis of variance of the trials"
    yield ["21"], ("table_21_displacement_regression",), "regression of the trials"
    yield "27 28 29".split(), ("tables_27_29_rotation_regression",), "regression of the trials"
    yield ["22"], ("table_22_displacement_rmse",), "errors of the trials"
    yield ["30"], ("table_30_rotation_rmse",), "errors of the trials"
    yield ["23"], ("table_23_required_moment",), "moment for 90 degrees"
    yield ["text"], ("text_statements",), "figures in the text"
    yield ["conversions"], ("text_conversions",), "conversions of units in the text"


FILES = {name: (files, title) for names, files, title in _files() for name in names}
"""Files (without .csv) and title of each table, by its name."""


@functools.cache
def _read(file: str) -> tuple[Row, ...]:
    text = (
        resources.files("pma_gym.data.serres2008")
        .joinpath(f"{file}.csv")
        .read_text(encoding="utf-8")
    )
    return tuple(csv.DictReader(text.splitlines()))


def _of_table(rows: Iterable[Row], name: str) -> Iterator[Row]:
    """The rows of one table, without the column that names it."""
    for row in rows:
        if row.get("table", name) == name:
            yield {column: text for column, text in row.items() if column != "table"}


def printed_rows(name: str) -> list[Row]:
    """The rows of a table with the figures as printed.

    Raises:
        KeyError: no such table; the message lists the tables.
    """
    if name not in FILES:
        raise KeyError(f"no table {name!r} of Serres 2008; there are {', '.join(FILES)}")
    parts = [_of_table(_read(file), name) for file in FILES[name][0]]
    return [
        {column: text for part in parts_of_row for column, text in part.items()}
        for parts_of_row in zip(*parts, strict=True)
    ]


_SHIFTED = "printed as a fraction from 275 kPa on, in percent before"
_EQUAL = "prints the return rotation in both columns; the neighbours give about 74, not recoverable"
_PRESSURE = "250 kPa was commanded, as in the first repeat; a digit is wrong"


@dataclass(frozen=True)
class Correction:
    """One corrected cell.

    Attributes:
        table: name of the table, such as "I3".
        row: index of the row in the table, from 0.
        where: the row in words.
        column: name of the column.
        printed: the figure as printed.
        corrected: the figure used instead, in the unit of the column; NaN where it is lost.
        reason: why.
    """

    table: str
    row: int
    where: str
    column: str
    printed: str
    corrected: float
    reason: str


# Table, cells that identify the row, which of the rows that match, column, printed, corrected.
_CELLS: tuple[tuple[str, Row, int, str, str, float, str], ...] = (
    (
        *("I3", {"pressure_nominal_kpa": "300", "load_nominal_n": "225"}, 1),
        *("pressure_kpa", "1310", 310.0, "over twice the rated pressure; a digit is too many"),
    ),
    (
        *("I3", {"pressure_nominal_kpa": "550", "load_nominal_n": "825"}, 3),
        *("return_mm", "358.9", 35.9, "longer than the muscle; 36.6 mm went out"),
    ),
    (
        *("I3", {"pressure_nominal_kpa": "550", "load_nominal_n": "825"}, 3),
        *("return_percent", "5.6788", 56.8, "35.9 mm of 63.2 mm; also printed as a fraction"),
    ),
    (
        *("I3", {"pressure_nominal_kpa": "250", "load_nominal_n": "75"}, 2),
        *("pressure_kpa", "205", 255.0, _PRESSURE),
    ),
    (
        *("I3", {"pressure_nominal_kpa": "250", "load_nominal_n": "75"}, 3),
        *("pressure_kpa", "205", 255.0, _PRESSURE),
    ),
    (
        *("I3", {"pressure_nominal_kpa": "300", "load_nominal_n": "900"}, 3),
        *("rotation_deg", "134", 114.0, "112 and 111 in the other repeats; a digit is wrong"),
    ),
    (
        *("I3", {"pressure_nominal_kpa": "300", "load_nominal_n": "450"}, 1),
        *("rotation_deg", "69.2", math.nan, _EQUAL),
    ),
    (
        *("I3", {"pressure_nominal_kpa": "300", "load_nominal_n": "450"}, 2),
        *("rotation_deg", "69", math.nan, _EQUAL),
    ),
    (
        *("17", {"pressure_kpa": "200"}, 1),
        *("extension_mm", "34.4", 37.4, "mean of table I3, and 110 % of 34.1 mm"),
    ),
    (
        *("18", {"pressure_kpa": "450"}, 1),
        *("v1_m_per_v", "0.0071", 0.0070, "fit of table I3, and used for tables I10 and I17"),
    ),
    (
        *("21", {"pressure_kpa": "150", "term": "slope"}, 1),
        *("t_ratio", "117.95", 177.95, "estimate over standard error; its square is table 20's F"),
    ),
    (
        *("26", {"pressure_kpa": "400"}, 1),
        *("ms_error", "2.04133", 2.30411, "its sum of squares over 1921; a digit is missing"),
    ),
    (
        *("27", {"pressure_kpa": "275", "term": "slope"}, 1),
        *("t_ratio", "237.45", 237.34, "estimate over standard error, and the root of F"),
    ),
    (
        *("28", {"pressure_kpa": "350", "term": "slope"}, 1),
        *("std_error", "0.24252", 0.024252, "estimate over t ratio; a zero is missing"),
    ),
    (
        *("28", {"pressure_kpa": "550", "term": "slope"}, 1),
        *("std_error", "0.26653", 0.026653, "estimate over t ratio; a zero is missing"),
    ),
    (
        *("29", {"pressure_kpa": "350", "term": "intercept"}, 1),
        *("t_ratio", "1125.2", 1125.4, "estimate over standard error"),
    ),
    (
        *("29", {"pressure_kpa": "575", "term": "slope"}, 1),
        *("t_ratio", "-1000.0", -1015.5, "estimate over standard error, and the root of F"),
    ),
)


def _matching_row(rows: list[Row], cells: Row, repeat: int) -> int:
    matches = [i for i, row in enumerate(rows) if cells.items() <= row.items()]
    return matches[repeat - 1]


def _cell_corrections() -> Iterator[Correction]:
    for table, cells, repeat, column, printed, corrected, reason in _CELLS:
        where = ", ".join(f"{name} {text}" for name, text in cells.items())
        where += f", repeat {repeat}" if table == "I3" else ""
        row = _matching_row(printed_rows(table), cells, repeat)
        yield Correction(table, row, where, column, printed, corrected, reason)


def _percent_corrections(done: set[tuple[int, str]]) -> Iterator[Correction]:
    """Table I3 changes the unit of its percent columns between 250 and 275 kPa."""
    for index, row in enumerate(printed_rows("I3")):
        if float(row["pressure_nominal_kpa"]) < 275:
            continue
        where = f"row {index + 1}, {row['pressure_nominal_kpa']} kPa, {row['load_nominal_n']} N"
        for column in ("extension_percent", "return_percent"):
            if (index, column) not in done:
                percent = float(100 * Decimal(row[column]))
                yield Correction("I3", index, where, column, row[column], percent, _SHIFTED)


@functools.cache
def _all_corrections() -> tuple[Correction, ...]:
    cells = tuple(_cell_corrections())
    done = {(item.row, item.column) for item in cells if item.table == "I3"}
    return (*cells, *_percent_corrections(done))


def corrections(table: str | None = None) -> tuple[Correction, ...]:
    """Every corrected cell, the misprinted figures first, then table I3's change of unit.

    Args:
        table: name of a table, or None for all.

    >>> [c.corrected for c in corrections("28")]
    [0.024252, 0.026653]
    """
    return tuple(item for item in _all_corrections() if table in (None, item.table))
