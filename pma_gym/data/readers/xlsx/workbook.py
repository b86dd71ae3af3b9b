"""XLSX workbooks: every sheet's filled cells, read as a stream.

The format is read here because what a workbook declares is not to be trusted: the size of a sheet,
the number of a row, the count of its texts. A reader that allocates by them, or loads every style,
takes gigabytes for a file of kilobytes. Source: ECMA-376, part 1, sections 18.2 to 18.8.
"""

import io
import zipfile
from dataclasses import replace

from pma_gym.data.readers.layout import arrange
from pma_gym.data.readers.table import (
    PART,
    PROVENANCE,
    NoHeaderError,
    Request,
    Table,
    UnreadableError,
)
from pma_gym.data.readers.xlsx.parts import STYLES, TEXTS, date_styles, shared_texts, sheet_names
from pma_gym.data.readers.xlsx.sheet import Book, Sheet, read_sheet
from pma_gym.data.readers.xlsx.xml import BadXmlError
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import LimitError, check_limit

_SMALL_MIB = 16
"""Size that a workbook may unpack to however small it is."""


def read_xlsx(content: bytes, file: str, request: Request = Request()) -> list[Table]:  # noqa: B008
    """The tables in a workbook, one a sheet that has any; the sheet "provenance" is none.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names, and the lab's description of its files.
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


def _tables(archive: zipfile.ZipFile, file: str, request: Request, size: int) -> list[Table]:
    infos = archive.infolist()
    unpacked = sum(info.file_size for info in infos)
    check_limit(file, "table_mib", unpacked / 2**20)
    if unpacked > _SMALL_MIB * 2**20:
        check_limit(file, "packing", unpacked / size)
    names = {info.filename for info in infos}
    sheets, epoch = sheet_names(archive, names)
    check_limit(file, "sheets", len(sheets))
    if len({part for _, _, part in sheets}) < len(sheets):
        raise BadXmlError("two of its sheets are one")
    texts = shared_texts(archive, file) if TEXTS in names else []
    dates = date_styles(archive) if STYLES in names else set()
    book = Book(texts, dates, epoch)
    notes: dict[str, str] = {}
    read: list[tuple[str, bool, Sheet]] = []
    for name, hidden, part in sheets:
        # A title is a part of a path: march.xlsx#run2.
        title = name.replace("/", "_")
        sheet = read_sheet(archive, part, book, file)
        if title == PROVENANCE:
            notes = _notes(sheet)
        elif sheet.rows:
            read.append((title, hidden, sheet))
    return _arranged(read, file, request, notes)


def _arranged(
    read: list[tuple[str, bool, Sheet]], file: str, request: Request, notes: dict[str, str]
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


def _check_formulas(table: Table, sheet: Sheet, title: str) -> None:
    """Refuse formulas whose values a spreadsheet program never stored."""
    rows = set(table.rows)
    lost = [(row, column) for row, column in sheet.unstored if row in rows]
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


def _notes(sheet: Sheet) -> dict[str, str]:
    """Pairs of a sheet's first two columns."""
    out = {}
    for _, row in sheet.rows:
        if row and row[0] is not None:
            value = row[1] if len(row) > 1 else None
            out[str(row[0])] = "" if value is None else str(value)
    return out
