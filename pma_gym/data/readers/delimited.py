"""Text tables: cells between commas, semicolons, tabs, bars or blanks."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from pma_gym.data.readers import labview
from pma_gym.data.readers.decoding import decode_text
from pma_gym.data.readers.layout import COMMENTS, Row, arrange
from pma_gym.data.readers.table import Request, Table, UnreadableError
from pma_gym.data.readers.text_lines import check_widths, split_lines
from pma_gym.limits import check_limit, limit

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
