"""Text tables: cells between commas, semicolons, tabs, bars or blanks.

Bytes of a text file to text: UTF-8, UTF-16 with or without its mark, else Windows-1252.
"""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from pma_gym.data.readers import labview
from pma_gym.data.readers.layout import COMMENTS, Row, arrange, check_widths, split_lines
from pma_gym.data.readers.table import Request, Table, UnreadableError
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import check_limit, limit

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    # Before UTF-16's, whose mark begins this one.
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_SAMPLE = 4096
"""Bytes that tell UTF-16 by its zeros."""
_MANY = 0.4
"""Share of zeros at every other byte from which a text is UTF-16: Latin letters and digits."""


def decode_text(
    content: bytes, file: str, encoding: str | None = None
) -> tuple[str, tuple[str, ...]]:
    """Text of a file.

    Zero bytes at its end are what a file system leaves that lost its power: they are passed over,
    and so is a row before them whose end was not written.

    Args:
        content: its bytes.
        file: its name, for messages.
        encoding: which encoding to take; None: by mark, else by content. Text that is no UTF-8 is
            read as Windows-1252, in which every byte of a number is what it is in ASCII.
    Returns:
        The text, without a byte order mark, and remarks on what was passed over.
    Raises:
        UnreadableError: bytes that are no text, or not of that encoding.
        TrialError: no such encoding.
        LimitError: more text than is read.
    """
    check_limit(file, "text_mib", len(content) / 2**20)
    if encoding is None:
        mark, encoding = next(((m, name) for m, name in _MARKS if content.startswith(m)), (b"", ""))
        content = content[len(mark) :]
        encoding = encoding or _guess(content)
    wide = 4 if "32" in encoding else 2 if "16" in encoding else 1
    # Zeros may end within a character of UTF-16.
    missing = -len(content) % wide if content.endswith(b"\0") else 0
    content += bytes(missing)
    try:
        text = content.decode(encoding)
    except UnicodeError as error:
        at = f" (byte {error.start})" if isinstance(error, UnicodeDecodeError) else ""
        said = f"{file} is not {encoding} text{at}; save it as 'CSV UTF-8'"
        raise UnreadableError(said) from None
    except LookupError:
        raise TrialError(
            f"{encoding!r} is no encoding of text; give another, for example 'cp1252'"
        ) from None
    text = text.removeprefix("\ufeff")
    whole = text.rstrip("\0")
    zeros, at = text.count("\0") * wide - missing, text.find("\0")
    if 0 <= at < max(len(whole), 1):
        raise UnreadableError(
            f"{file} holds {zeros} zero bytes, the first in row {_rows(text[:at] + '-')}: it is no "
            "text there; remove them, or save it as 'CSV UTF-8'"
        )
    if not zeros:
        return whole, ()
    said = f"{zeros} zero bytes behind row {_rows(whole)}, as a loss of power leaves them, are "
    if whole.endswith(("\n", "\r")):
        return whole, (f"{said}passed over",)
    last = max(whole.rfind("\n"), whole.rfind("\r"))
    return whole[: last + 1], (f"{said}passed over, and so is that row, whose end is missing",)


def _rows(text: str) -> int:
    """How many rows a text has."""
    return max(text.count("\n"), text.count("\r")) + (not text.endswith(("\n", "\r")))


def _guess(content: bytes) -> str:
    """Encoding of bytes without a mark."""
    sample = content.rstrip(b"\0")[:_SAMPLE]
    even, odd = sample[::2].count(0), sample[1::2].count(0)
    if odd >= _MANY * (len(sample) / 2) > 0 and not even:
        return "utf-16-le"
    if even >= _MANY * (len(sample) / 2) > 0 and not odd:
        return "utf-16-be"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        # latin-1 names the five bytes that Windows-1252 leaves open.
        open_bytes = bytes(range(0x80, 0xA0)).translate(None, delete=_DEFINED)
        return "latin-1" if any(byte in content for byte in open_bytes) else "cp1252"
    return "utf-8"


_DEFINED = bytes(set(range(0x80, 0xA0)) - {0x81, 0x8D, 0x8F, 0x90, 0x9D})

SEPARATORS = ("\t", ";", "|", ",")
"""In the order of preference: a comma may be a decimal mark where another one separates."""

BLANKS = " "
"""Stands for any run of blanks between cells."""

_LOOKED_AT = 1000
"""Lines by which the separator is chosen."""
_SEARCHED = 200
"""Rows from the top among which a header is looked for."""
_SHARE = 0.6
"""Share of the lines that must agree on their number of separators."""


def read_text(content: bytes, file: str, request: Request = Request()) -> list[Table]:  # noqa: B008
    """The tables in a text file: one, or one a segment of a LabVIEW file.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names, and the lab's description of its files.
    Returns:
        Tables; the one of an ordinary file.
    Raises:
        TrialError: bytes that are no text, or rows that are no table.
    """
    text, remarks = decode_text(content, file, request.format.encoding)
    tables = (
        labview.read_labview(text, file, request)
        if labview.is_labview(text)
        else [arrange(file, split_rows(text, file, request), request)]
    )
    return [replace(tables[0], remarks=(*remarks, *tables[0].remarks)), *tables[1:]]


def split_rows(text: str, file: str, request: Request) -> list[Row]:
    """Numbered rows of a text, cells as texts.

    Raises:
        TrialError: quotes that do not end, or more rows, columns or cells than are read.
    """
    lines = split_lines(text, file)
    separator = request.format.separator or choose_separator(lines, request)
    check_widths(lines, separator, file)
    rows: list[Row] = []
    cells, most_columns, most_cells = 0, limit("columns"), limit("cells")
    for number, row in _split(lines, separator, file):
        if not any(cell.strip() for cell in row):
            continue
        cells += len(row)
        if len(row) > most_columns or cells > most_cells:
            check_limit(file, "columns", len(row))
            check_limit(file, "cells", cells)
        rows.append((number, row))
    return _uncommented_header(rows, request)


def _split(lines: Sequence[str], separator: str, file: str):  # noqa: ANN202
    if separator == BLANKS:
        for number, line in enumerate(lines, start=1):
            yield number, line.split()
        return
    # A quote in a remark opens no cell.
    quiet = ["\n" if line.startswith(COMMENTS) and '"' in line else line for line in lines]
    reader = csv.reader(quiet, delimiter=separator)
    try:
        for row in reader:
            yield reader.line_num, row
    except csv.Error as error:
        raise UnreadableError(
            f"{file}, row {reader.line_num}: {error}; is it a CSV file?"
        ) from None


def choose_separator(lines: Sequence[str], request: Request) -> str:
    """The separator that gives most lines the same number of cells.

    One that makes a known name of the time a cell of its own is preferred.
    """
    texts = [line for line in lines[:_LOOKED_AT] if line.strip() and not line.startswith(COMMENTS)]
    fitting = [mark for mark in SEPARATORS if _fits([text.count(mark) for text in texts])]
    for mark in (*SEPARATORS, BLANKS):
        for text in texts[:200]:
            names = text.split() if mark == BLANKS else text.split(mark)
            if len(names) > 1 and any(request.is_time(name.strip(' "\r\n')) for name in names):
                return mark
    if fitting:
        return fitting[0]
    return BLANKS if _fits([len(text.split()) - 1 for text in texts]) else ","


def _fits(counts: Sequence[int]) -> bool:
    """Whether most lines have the same number of separators, and have any."""
    usual, often = Counter(counts).most_common(1)[0] if counts else (0, 0)
    return usual > 0 and often >= _SHARE * len(counts)


def _uncommented_header(rows: list[Row], request: Request) -> list[Row]:
    """Rows whose header, if it is the last of the leading remarks, is one no more.

    NumPy and gnuplot write `# time_s, load_n`.
    """
    marked = [str(row[1][0]).lstrip().startswith(COMMENTS) for row in rows[:_SEARCHED]]
    leading = marked.index(False) if False in marked else 0
    named = (cell for _, row in rows[leading:_SEARCHED] for cell in row)
    if not leading or any(request.is_time(str(cell).strip()) for cell in named):
        return rows
    number, texts = rows[leading - 1]
    row = [str(cell) for cell in texts]
    bare = [re.sub(r"^\s*(?:#|%|//)+\s*", "", row[0]), *row[1:]]
    bare = bare[1:] if not bare[0].strip() else bare
    if any(request.is_time(cell.strip()) for cell in bare):
        rows = list(rows)
        rows[leading - 1] = (number, bare)
    return rows
