"""XLSX workbooks: every sheet's filled cells, read as a stream.

The format is read here because what a workbook declares is not to be trusted: the size of a sheet,
the number of a row, the count of its texts. A reader that allocates by them, or loads every style,
takes gigabytes for a file of kilobytes. Source: ECMA-376, part 1, sections 18.2 to 18.8.
"""

import datetime
import io
import posixpath
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from xml.parsers import expat

from pma_gym.data.readers.layout import Row, arrange
from pma_gym.data.readers.table import (
    PART,
    PROVENANCE,
    NoHeaderError,
    Request,
    Table,
    UnreadableError,
    shown,
)
from pma_gym.data.readers.xlsx_dates import EPOCH_1900, EPOCH_1904, date_of, is_date_format
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import LimitError, check_limit, limit

_LAST_ROW, _LAST_COLUMN, _LONGEST_TEXT = 1_048_576, 16_384, 32_767
"""Of a sheet, and characters of a cell, by the format."""
_CHUNK = 1 << 16
_MOST = 100_000
"""Styles, sheets and links of a workbook; spreadsheet programs write 64 000 styles at most."""
_SMALL_MIB = 16
"""Size that a workbook may unpack to however small it is."""


@dataclass
class _Sheet:
    """What a sheet's XML holds.

    Attributes:
        rows: number and cells of rows that are not empty.
        unstored: (row, column) of formulas without a stored value.
        stored: columns in which some formula has one.
    """

    rows: list[Row] = field(default_factory=list)
    unstored: list[tuple[int, int]] = field(default_factory=list)
    stored: set[int] = field(default_factory=set)


@dataclass
class _Book:
    """What all sheets of a workbook share."""

    texts: list[str]
    dates: set[int]
    epoch: datetime.datetime


def read_xlsx(content: bytes, file: str, request: Request = Request()) -> list[Table]:  # noqa: B008
    """The tables in a workbook, one a sheet that has any; the sheet "provenance" is none.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names, and what the lab says about its files.
    Returns:
        Tables in the order of the sheets; hidden sheets only where no other holds a table.
    Raises:
        TrialError: a damaged workbook, formulas without stored values, or beyond a limit.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return _tables(archive, file, request, len(content))
    except (TrialError, LimitError):
        raise
    # A damaged workbook fails in many ways: BadZipFile, zlib.error, ExpatError, KeyError...
    except Exception as error:
        reason = str(error)[:200] or type(error).__name__
        raise UnreadableError(f"{file} is not a readable XLSX file: {reason}") from None


class _BadXml(Exception):
    """XML that no workbook has."""


def _tables(archive: zipfile.ZipFile, file: str, request: Request, size: int) -> list[Table]:
    infos = archive.infolist()
    unpacked = sum(info.file_size for info in infos)
    check_limit(file, "table_mib", unpacked / 2**20)
    if unpacked > _SMALL_MIB * 2**20:
        check_limit(file, "packing", unpacked / size)
    names = {info.filename for info in infos}
    sheets, epoch = _sheet_names(archive, names)
    check_limit(file, "sheets", len(sheets))
    texts = _shared_texts(archive, file) if _TEXTS in names else []
    dates = _date_styles(archive) if _STYLES in names else set()
    book = _Book(texts, dates, epoch)
    notes: dict[str, str] = {}
    read: list[tuple[str, bool, _Sheet]] = []
    for name, hidden, part in sheets:
        # A title is a part of a path: march.xlsx#run2.
        title = name.replace("/", "_")
        sheet = _read_sheet(archive, part, book, file)
        if title == PROVENANCE:
            notes = _notes(sheet)
        elif sheet.rows:
            read.append((title, hidden, sheet))
    return _arranged(read, file, request, notes)


def _arranged(
    read: list[tuple[str, bool, _Sheet]], file: str, request: Request, notes: dict[str, str]
) -> list[Table]:
    """Tables of the sheets; what no table is made of is remarked."""
    remarks: list[str] = []
    shown_ones = [each for each in read if not each[1]]
    if shown_ones:
        remarks += [
            f"the hidden sheet {title!r} is passed over; show it if it is a trial"
            for title, hidden, _ in read
            if hidden
        ]
        read = shown_ones
    tables: list[Table] = []
    failures: list[TrialError] = []
    for title, _, sheet in read:
        name = f"{file}{PART}{title}" if len(read) > 1 else file
        try:
            table = arrange(name, sheet.rows, request, provenance=notes, part=title, padded=True)
            _check_formulas(table, sheet, title)
            tables.append(table)
        except (UnreadableError, NoHeaderError) as error:
            failures.append(error)
            remarks.append(f"the sheet {title!r} is passed over, it is no table")
    if not tables and failures:
        raise failures[0]
    if tables:
        tables[0] = replace(tables[0], remarks=(*tables[0].remarks, *remarks))
    return tables or [Table(file, [], [], [], notes)]


def _check_formulas(table: Table, sheet: _Sheet, title: str) -> None:
    """Refuse a column of formulas whose values a spreadsheet program never stored."""
    rows = set(table.rows)
    lost = [(r, c) for r, c in sheet.unstored if c not in sheet.stored and r in rows]
    if lost:
        row, column = lost[0]
        more = f" and {len(lost) - 1} more" if len(lost) > 1 else ""
        raise TrialError(
            f"cell {_letters(column)}{row}{more} of {table.file}, sheet {title!r}, hold formulas "
            "without stored values; open the file in a spreadsheet program and save it once"
        )


def _letters(column: int) -> str:
    """Letters of a column, counted from 0: A, B, ... AA."""
    out = ""
    column += 1
    while column:
        column, rest = divmod(column - 1, 26)
        out = chr(65 + rest) + out
    return out


def _notes(sheet: _Sheet) -> dict[str, str]:
    """Pairs of a sheet's first two columns."""
    out = {}
    for _, row in sheet.rows:
        if row and row[0] is not None:
            value = row[1] if len(row) > 1 else None
            out[str(row[0])] = "" if value is None else str(value)
    return out


_TEXTS, _STYLES = "xl/sharedStrings.xml", "xl/styles.xml"
_BOOK, _LINKS = "xl/workbook.xml", "xl/_rels/workbook.xml.rels"


def _sheet_names(
    archive: zipfile.ZipFile, names: set[str]
) -> tuple[list[tuple[str, bool, str]], datetime.datetime]:
    """Title, whether hidden, and part of each sheet; and where its dates begin to count."""
    links: dict[str, str] = {}
    for tag, attributes, _ in _elements(archive, _LINKS, {"Relationship"}):
        assert tag
        target = attributes.get("Target", "")
        part = target.lstrip("/") if target.startswith("/") else posixpath.join("xl", target)
        links[attributes.get("Id", "")] = posixpath.normpath(part)
    sheets: list[tuple[str, bool, str]] = []
    epoch = EPOCH_1900
    for tag, attributes, _ in _elements(archive, _BOOK, {"sheet", "workbookPr"}):
        if tag == "workbookPr":
            if attributes.get("date1904", "") in ("1", "true"):
                epoch = EPOCH_1904
            continue
        part = links.get(attributes.get("id", ""), "")
        # A sheet that is a chart has no cells.
        if part in names and "worksheets" in part:
            hidden = attributes.get("state", "visible") != "visible"
            sheets.append((attributes.get("name", ""), hidden, part))
    if not sheets:
        raise _BadXml("it has no sheet")
    return sheets, epoch


def _date_styles(archive: zipfile.ZipFile) -> set[int]:
    """Numbers of the styles that show a cell as a date or a time."""
    formats: dict[str, str] = {}
    dates: set[int] = set()
    inside, index = False, 0
    for tag, attributes, ended in _elements(
        archive, _STYLES, {"numFmt", "cellXfs", "xf"}, ends={"cellXfs"}
    ):
        if tag == "numFmt":
            formats[attributes.get("numFmtId", "")] = attributes.get("formatCode", "")
        elif tag == "cellXfs":
            inside = not ended
        elif inside:
            number = attributes.get("numFmtId", "0")
            if is_date_format(number, formats.get(number)):
                dates.add(index)
            index += 1
    return dates


def _shared_texts(archive: zipfile.ZipFile, file: str) -> list[str]:
    """Texts that cells refer to by number."""
    texts: list[str] = []
    parts: list[str] = []
    state = {"t": False, "rPh": 0}
    most = limit("cells")

    def start(tag: str, _: dict[str, str]) -> None:
        if tag == "si":
            parts.clear()
        elif tag == "rPh":
            state["rPh"] += 1
        state["t"] = tag == "t" and not state["rPh"]

    def end(tag: str) -> None:
        if tag == "si":
            texts.append(_limited(parts))
            if len(texts) > most:
                check_limit(file, "cells", len(texts))
        elif tag == "rPh":
            state["rPh"] -= 1
        state["t"] = False

    def data(text: str) -> None:
        if state["t"]:
            parts.append(text)

    _parse(archive, _TEXTS, start, end, data)
    return texts


def _limited(parts: list[str]) -> str:
    text = "".join(parts)
    if len(text) > _LONGEST_TEXT:
        raise _BadXml(f"a cell holds {len(text)} characters, the format allows {_LONGEST_TEXT}")
    return text


def _read_sheet(archive: zipfile.ZipFile, part: str, book: _Book, file: str) -> _Sheet:
    """The filled cells of a sheet."""
    reader = _SheetReader(book, file)
    _parse(archive, part, reader.start, reader.end, reader.data)
    return reader.sheet


class _SheetReader:
    """Takes the XML of a sheet event by event."""

    def __init__(self, book: _Book, file: str) -> None:
        self.sheet = _Sheet()
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
            raise _BadXml(f"a cell stands in column {self._column + 1}, beyond the last")
        self._cell, self._text, self._formula = attributes, [], False

    def _end_cell(self) -> None:
        assert self._cell is not None
        value = self._value(self._cell)
        if self._formula:
            if value is None:
                if len(self.sheet.unstored) < 2_000_000:
                    self.sheet.unstored.append((self._number, self._column))
            else:
                self.sheet.stored.add(self._column)
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
        text = _limited(self._text)
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
        raise _BadXml(f"{shown(text)} is no position")
    if not least <= number <= last:
        raise _BadXml(f"position {number} is not in {least} to {last}")
    return number


def _column(letters: str) -> int:
    """Position of a column, counted from 0, by its letters."""
    if len(letters) > 3 or not all("A" <= letter <= "Z" for letter in letters):
        raise _BadXml(f"{shown(letters)} is no column")
    number = 0
    for letter in letters:
        number = 26 * number + ord(letter) - 64
    return number - 1


def _elements(
    archive: zipfile.ZipFile,
    part: str,
    tags: set[str],
    ends: frozenset[str] | set[str] = frozenset(),
) -> Iterator[tuple[str, dict[str, str], bool]]:
    """Tag, attributes and whether it ended, of some elements of a part."""
    out: list[tuple[str, dict[str, str], bool]] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag in tags:
            out.append((tag, attributes, False))
            if len(out) > _MOST:
                raise _BadXml(f"{part} lists over {_MOST} things")

    def end(tag: str) -> None:
        if tag in ends:
            out.append((tag, {}, True))

    _parse(archive, part, start, end, lambda _: None)
    yield from out


def _parse(archive: zipfile.ZipFile, part: str, start, end, data) -> None:  # noqa: ANN001
    """Hand the events of a part's XML on, names without their namespace."""
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True

    def local(name: str) -> str:
        return name.rpartition(" ")[2]

    parser.StartElementHandler = lambda tag, attributes: start(
        local(tag), {local(name): value for name, value in attributes.items()}
    )
    parser.EndElementHandler = lambda tag: end(local(tag))
    parser.CharacterDataHandler = data

    def refuse(*_: object) -> None:
        # Entities may grow without bound.
        raise _BadXml("its XML declares a document type, which no workbook does")

    parser.StartDoctypeDeclHandler = refuse
    with archive.open(part) as source:
        while chunk := source.read(_CHUNK):
            parser.Parse(chunk, False)
        parser.Parse(b"", True)
