"""A sheet of a workbook: its filled cells, wherever it says that it begins and ends."""

import datetime
import zipfile
from dataclasses import dataclass, field

from pma_gym.data.readers.layout import Row
from pma_gym.data.readers.table import shown
from pma_gym.data.readers.xlsx.dates import date_of
from pma_gym.data.readers.xlsx.xml import BadXmlError, cell_text, parse_xml
from pma_gym.limits import check_limit, limit

_LAST_ROW, _LAST_COLUMN = 1_048_576, 16_384
"""Of a sheet, by the format."""


@dataclass
class Sheet:
    """What a sheet's XML holds.

    Attributes:
        rows: number and cells of rows that are not empty.
        unstored: (row, column) of formulas without a stored value.
    """

    rows: list[Row] = field(default_factory=list)
    unstored: list[tuple[int, int]] = field(default_factory=list)


@dataclass
class Book:
    """What all sheets of a workbook share."""

    texts: list[str]
    dates: set[int]
    epoch: datetime.datetime


def read_sheet(archive: zipfile.ZipFile, part: str, book: Book, file: str) -> Sheet:
    """The filled cells of a sheet."""
    reader = _SheetReader(book, file)
    parse_xml(archive, part, reader.start, reader.end, reader.data)
    return reader.sheet


class _SheetReader:
    """Takes the XML of a sheet event by event."""

    def __init__(self, book: Book, file: str) -> None:
        self.sheet = Sheet()
        self._book, self._file = book, file
        # Asked once: the environment is slow to ask for every cell.
        self._columns, self._rows, self._cells = map(limit, ("columns", "rows", "cells"))
        self._number, self._column = 0, -1
        self._row: list[object] = []
        self._cell: dict[str, str] | None = None
        self._text: list[str] = []
        self._taking = self._formula = False
        self._count = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Begins a row, a cell, or what a cell holds."""
        if tag == "row":
            self._begin_row(attributes.get("r"))
        elif tag == "c":
            self._begin_cell(attributes)
        elif self._cell is not None:
            if tag == "f":
                self._formula = True
            # Phonetic runs (rPh) say how a text is spoken.
            self._taking = tag in ("v", "t")

    def end(self, tag: str) -> None:
        """Ends them."""
        if tag == "c" and self._cell is not None:
            self._end_cell()
        elif tag == "row":
            self._end_row()
        elif tag in ("v", "t"):
            self._taking = False

    def data(self, text: str) -> None:
        """Characters."""
        if self._taking:
            self._text.append(text)

    def _begin_row(self, given: str | None) -> None:
        self._number = _position(given, self._number + 1, _LAST_ROW)
        self._row, self._column = [], -1

    def _begin_cell(self, attributes: dict[str, str]) -> None:
        place = attributes.get("r", "")
        letters = place.rstrip("0123456789")
        self._column = _column(letters) if letters else self._column + 1
        if self._column >= _LAST_COLUMN:
            raise BadXmlError(f"a cell stands in column {self._column + 1}, beyond the last")
        self._cell, self._text, self._formula = attributes, [], False

    def _end_cell(self) -> None:
        assert self._cell is not None
        value = self._value(self._cell)
        if self._formula:
            # A formula that gives an empty text says so: its type is "str".
            if value is None and self._cell.get("t") != "str":
                self.sheet.unstored.append((self._number, self._column))
        self._cell = None
        if value is None:
            return
        if self._column >= self._columns:
            check_limit(self._file, "columns", self._column + 1)
        self._row.extend([None] * (self._column + 1 - len(self._row)))
        self._row[self._column] = value

    def _end_row(self) -> None:
        if self._row:
            self.sheet.rows.append((self._number, tuple(self._row)))
            if len(self.sheet.rows) > self._rows:
                check_limit(self._file, "rows", len(self.sheet.rows))
            # The empty cells before a filled one take memory too.
            self._count += len(self._row)
            if self._count > self._cells:
                check_limit(self._file, "cells", self._count)
        self._row = []

    def _value(self, cell: dict[str, str]) -> object:
        """A cell's number, text or date; None if it is empty."""
        text = cell_text(self._text)
        kind = cell.get("t", "n")
        if kind == "s":
            index = _position(text.strip(), -1, len(self._book.texts) - 1, least=0)
            return self._book.texts[index] or None
        if kind in ("str", "inlineStr", "e"):
            return text or None
        bare = text.strip()
        if not bare:
            return None
        if kind == "b":
            return bare == "1"
        if kind == "d":
            return bare
        return self._number_or_date(bare, cell.get("s", "0"))

    def _number_or_date(self, bare: str, style: str) -> object:
        try:
            number = float(bare) if "_" not in bare and bare.isascii() else None
        except ValueError:
            number = None
        if number is None or number != number:
            return bare
        if style.isdigit() and len(style) < 7 and int(style) in self._book.dates:
            date = date_of(number, self._book.epoch)
            return bare if date is None else date
        return number


def _position(text: str | None, usual: int, last: int, least: int = 1) -> int:
    """A whole number of a file within its bounds."""
    if text is None or text == "":
        number = usual
    elif text.isascii() and text.isdigit() and len(text) < 9:
        number = int(text)
    else:
        raise BadXmlError(f"{shown(text)} is no position")
    if not least <= number <= last:
        raise BadXmlError(f"position {number} is not in {least} to {last}")
    return number


def _column(letters: str) -> int:
    """Position of a column, counted from 0, by its letters."""
    if len(letters) > 3 or not all("A" <= letter <= "Z" for letter in letters):
        raise BadXmlError(f"{shown(letters)} is no column")
    number = 0
    for letter in letters:
        number = 26 * number + ord(letter) - 64
    return number - 1
