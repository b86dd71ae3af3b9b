"""Misprints of the tables: what is printed, what is used instead, and why.

A misprint is corrected where another figure of the dissertation gives the right one. Where the
right figure cannot be recovered the cell becomes NaN: a neighbour's value would be an invented
measurement.
"""

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal

from pma_gym.data.serres2008.printed import Row, printed_rows

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
