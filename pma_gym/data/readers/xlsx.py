"""XLSX workbooks: openpyxl reads every sheet's filled cells as a stream.

openpyxl rounds dates to milliseconds, so it hands on the number of days and the date is made here.
It has a formula or its stored value, not both: where a cell is empty, a second pass looks for
formulas.
"""

import datetime
import io
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

from pma_gym.data.files.trial_formats import needed
from pma_gym.data.readers.layout import Row, arrange
from pma_gym.data.readers.table import (
    PART,
    PROVENANCE,
    NoHeaderError,
    Request,
    Table,
    UnreadableError,
)
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import check_limit, limit

_SMALL_MIB = 16
"""Size that a workbook may unpack to however small it is."""
_LAST_ROW = 1_048_576
"""Of a sheet, by the format."""


def read(content: bytes, file: str, request: Request) -> list[Table]:
    """The tables in a workbook, one a sheet that has any; the sheet "provenance" is none.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names, and the lab's description of its files.
    Returns:
        Tables in the order of the sheets; hidden sheets only where no other holds a table.
    Raises:
        TrialError: no table, or formulas without stored values.
        LimitError: beyond a limit.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        unpacked = sum(info.file_size for info in archive.infolist())
    check_limit(file, "table_mib", unpacked / 2**20)
    if unpacked > _SMALL_MIB * 2**20:
        check_limit(file, "packing", unpacked / len(content))
    book = cache(lambda data_only: _book(content, file, data_only))
    values = book(True)
    check_limit(file, "sheets", len(values.worksheets))
    notes: dict[str, str] = {}
    sheets: list[tuple[str, bool, list[Row], set[tuple[int, int]]]] = []
    for sheet in values.worksheets:
        # A title is a part of a path: march.xlsx#run2.
        title = sheet.title.replace("/", "_")
        rows, empty = _rows(sheet, values.epoch, file)
        if title == PROVENANCE:
            notes = {str(row[0]): _text(row[1:2]) for _, row in rows if row[0] is not None}
        elif rows:
            unstored = empty and empty & set(_formulas(book(False)[sheet.title]))
            sheets.append((title, sheet.sheet_state != "visible", rows, unstored))
    return _arranged(sheets, file, request, notes)


def _book(content: bytes, file: str, data_only: bool) -> Any:  # noqa: ANN401
    """A workbook with stored values, or with formulas."""
    openpyxl = needed("openpyxl", file)
    book = openpyxl.load_workbook(
        io.BytesIO(content), read_only=True, data_only=data_only, keep_links=False
    )
    # Dates stay numbers of days.
    book._date_formats = set()
    for sheet in book.worksheets:
        # The size that a sheet declares may be wrong.
        sheet.reset_dimensions()
    return book


def _rows(
    sheet: Any,  # noqa: ANN401
    epoch: datetime.datetime,
    file: str,
) -> tuple[list[Row], set[tuple[int, int]]]:
    """The rows of a sheet that are not empty; (row, column) of cells that stand there empty."""
    rows: list[Row] = []
    empty: set[tuple[int, int]] = set()
    dates: dict[int, bool] = {}
    columns, most, count = limit("columns"), limit("cells"), 0
    for number, cells in _numbered(sheet):
        if len(cells) > columns:
            check_limit(file, "columns", len(cells))
        row: list[object] = []
        filled = 0
        for index, cell in enumerate(cells):
            value = cell.value
            if isinstance(value, int | float) and not isinstance(value, bool):
                style = cell._style_id
                if style not in dates:
                    dates[style] = cell.is_date
                value = _date(value, epoch) if dates[style] else float(value)
            elif value is None and cell.data_type == "n" and hasattr(cell, "row"):
                empty.add((number, index))
            elif value is not None and cell.data_type == "d":
                # A date in ISO 8601, as strict workbooks have it.
                value = str(value)
            row.append(None if value == "" else value)
            filled = filled if row[-1] is None else index + 1
        if filled:
            rows.append((number, row[:filled]))
            check_limit(file, "rows", len(rows))
            # The empty cells before a filled one take memory too.
            count += filled
            if count > most:
                check_limit(file, "cells", count)
    return rows, empty


def _numbered(sheet: Any) -> Iterator[tuple[int, Any]]:  # noqa: ANN401
    """Rows with their numbers."""
    for number, cells in enumerate(sheet.iter_rows(), start=1):
        if number > _LAST_ROW:
            raise ValueError(f"sheet {sheet.title!r} has over {_LAST_ROW} rows")
        yield number, cells


def _formulas(sheet: Any) -> Iterator[tuple[int, int]]:  # noqa: ANN401
    for number, cells in _numbered(sheet):
        yield from ((number, i) for i, cell in enumerate(cells) if cell.data_type == "f")


def _date(days: float, epoch: datetime.datetime) -> object:
    """A date as text, the number where no calendar has it; a time without date is of day 0."""
    try:
        # Spreadsheets keep 15 digits of days, some microseconds.
        date = epoch + datetime.timedelta(microseconds=round(days * 86_400e6))
    except (OverflowError, ValueError):
        return float(days)
    return date.isoformat(" ")


def _text(cells: Any) -> str:  # noqa: ANN401
    return "".join(str(cell) for cell in cells if cell is not None)


def _arranged(
    sheets: list[tuple[str, bool, list[Row], set[tuple[int, int]]]],
    file: str,
    request: Request,
    notes: dict[str, str],
) -> list[Table]:
    """Tables of the sheets; what no table is made of is remarked."""
    remarks: list[str] = []
    shown_ones = [each for each in sheets if not each[1]]
    if shown_ones:
        remarks += [
            f"the hidden sheet {title!r} is passed over; show it if it is a trial"
            for title, hidden, *_ in sheets
            if hidden
        ]
        sheets = shown_ones
    tables: list[Table] = []
    failures: list[TrialError] = []
    for title, _, rows, unstored in sheets:
        name = f"{file}{PART}{title}" if len(sheets) > 1 else file
        try:
            table = arrange(name, rows, request, provenance=notes, part=title, padded=True)
            _check_formulas(table, unstored, title)
            tables.append(table)
        except (UnreadableError, NoHeaderError) as error:
            failures.append(error)
            remarks.append(f"the sheet {title!r} is passed over, it is no table")
    if not tables and failures:
        raise failures[0]
    if tables:
        tables[0] = replace(tables[0], remarks=(*tables[0].remarks, *remarks))
    return tables or [Table(file, [], [], [], notes)]


def _check_formulas(table: Table, unstored: set[tuple[int, int]], title: str) -> None:
    """Refuse formulas whose values a spreadsheet program never stored."""
    rows = set(table.rows)
    lost = sorted((row, column) for row, column in unstored if row in rows)
    if lost:
        row, column = lost[0]
        letters = needed("openpyxl.utils", table.file).get_column_letter(column + 1)
        more = f" and {len(lost) - 1} more" if len(lost) > 1 else ""
        raise TrialError(
            f"cell {letters}{row}{more} of {table.file}, sheet {title!r}, hold formulas without "
            "stored values; open the file in a spreadsheet program and save it once"
        )
