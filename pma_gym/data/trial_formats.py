"""Plain tables in CSV, Parquet and XLSX: bytes to cells and back, without any meaning.

CSV is the format of a log and holds nothing but columns. Parquet keeps the provenance in its schema
metadata, XLSX on a second sheet.
"""

import csv
import importlib
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial_columns import TrialError

PROVENANCE = "provenance"
"""Name of the XLSX sheet and, after `pma_gym.`, of the Parquet metadata."""


@dataclass(frozen=True)
class Table:
    """Cells of a file as they stand there.

    Attributes:
        file: the file's name, for messages.
        header: names of the columns.
        cells: one sequence a column; None or "" where a cell is empty.
        rows: number of each row in the file, as an editor or a spreadsheet counts.
        provenance: metadata beside the table.
    """

    file: str
    header: Sequence[str]
    cells: Sequence[Sequence[object]]
    rows: Sequence[int]
    provenance: Mapping[str, str] = field(default_factory=dict)

    def place(self, index: int) -> str:
        """Where the sample of an index stands."""
        return f"row {self.rows[index]} of {self.file}"


Columns = Mapping[str, NDArray[np.float64]]
"""Values at the door by column name; NaN = empty."""


def decode_csv(content: bytes, file: str) -> Table:
    """The table in a CSV file; leading lines that begin with # are passed over.

    Raises:
        TrialError: not UTF-8, not separated by commas, or rows of unequal length.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TrialError(
            f"{file} is not UTF-8 text (byte {error.start}); save it as 'CSV UTF-8'"
        ) from None
    lines = list(io.StringIO(text, newline=""))
    for index in takewhile(lambda index: lines[index].startswith("#"), range(len(lines))):
        # Blanked, not removed, so that rows keep their numbers.
        lines[index] = "\n"
    reader = csv.reader(lines)
    try:
        numbered = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise TrialError(f"{file}, row {reader.line_num}: {error}; is it a CSV file?") from None
    return _table(file, numbered)


def encode_csv(columns: Columns, provenance: Mapping[str, str]) -> bytes:
    """A CSV file: shortest digits that name each double, an empty cell for NaN.

    The provenance is left out: a log has columns only.
    """
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(
        zip(*(map(_digits, array.tolist()) for array in columns.values()), strict=True)
    )
    return out.getvalue().encode()


def decode_parquet(content: bytes, file: str) -> Table:
    """The table in a Parquet file; its first record counts as row 1.

    Raises:
        TrialError: pyarrow is missing, or cannot read it.
    """
    pyarrow, parquet = _needed("pyarrow", file), _needed("pyarrow.parquet", file)
    try:
        table = parquet.read_table(io.BytesIO(content))
    except (pyarrow.ArrowException, OSError) as error:
        raise TrialError(f"{file} is not a readable Parquet file: {error}") from None
    notes = (table.schema.metadata or {}).get(f"pma_gym.{PROVENANCE}".encode(), b"{}")
    cells = [column.to_pylist() for column in table.columns]
    return Table(file, table.column_names, cells, range(1, table.num_rows + 1), json.loads(notes))


def encode_parquet(columns: Columns, provenance: Mapping[str, str]) -> bytes:
    """A Parquet file with null for NaN and the provenance as JSON in the schema's metadata."""
    pyarrow, parquet = _needed("pyarrow", ".parquet"), _needed("pyarrow.parquet", ".parquet")
    arrays = {name: pyarrow.array(array, from_pandas=True) for name, array in columns.items()}
    metadata = {f"pma_gym.{PROVENANCE}": json.dumps(dict(provenance))}
    out = io.BytesIO()
    parquet.write_table(pyarrow.table(arrays).replace_schema_metadata(metadata), out)
    return out.getvalue()


def decode_xlsx(content: bytes, file: str) -> Table:
    """The table on the first sheet of an XLSX file.

    Raises:
        TrialError: openpyxl is missing, or cannot read it.
    """
    openpyxl = _needed("openpyxl", file)
    try:
        book = openpyxl.load_workbook(io.BytesIO(content), read_only=True, data_only=True)
        sheets = {sheet.title: list(sheet.iter_rows(values_only=True)) for sheet in book.worksheets}
    # A damaged workbook fails as KeyError, BadZipFile, ParseError...: whatever part is hit first.
    except Exception as error:
        raise TrialError(f"{file} is not a readable XLSX file: {error}") from None
    book.close()
    numbered = list(enumerate(next(iter(sheets.values()), []), start=1))
    filled = [(number, row) for number, row in numbered if any(cell is not None for cell in row)]
    # Rows may come without their trailing empty cells.
    width = max((len(row) for _, row in filled), default=0)
    filled = [(number, (*row, *[None] * (width - len(row)))) for number, row in filled]
    pairs = (row[:2] for row in sheets.get(PROVENANCE, ()) if len(row) > 1)
    notes = {str(key): "" if note is None else str(note) for key, note in pairs}
    return _table(file, filled, notes)


def encode_xlsx(columns: Columns, provenance: Mapping[str, str]) -> bytes:
    """An XLSX file: sheets "trial" and, if there is any, "provenance"."""
    openpyxl = _needed("openpyxl", ".xlsx")
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("trial")
    sheet.append(list(columns))
    for row in zip(*(array.tolist() for array in columns.values()), strict=True):
        sheet.append([None if value != value else value for value in row])
    if provenance:
        notes = book.create_sheet(PROVENANCE)
        for item in provenance.items():
            notes.append(item)
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


DECODERS: dict[str, Callable[[bytes, str], Table]] = {
    ".csv": decode_csv,
    ".parquet": decode_parquet,
    ".xlsx": decode_xlsx,
}
"""Reader of each kind of file, by suffix."""

ENCODERS: dict[str, Callable[[Columns, Mapping[str, str]], bytes]] = {
    ".csv": encode_csv,
    ".parquet": encode_parquet,
    ".xlsx": encode_xlsx,
}
"""Writer of each kind of file, by suffix."""


def _table(
    file: str, numbered: Sequence[tuple[int, Sequence[Any]]], notes: Mapping[str, str] | None = None
) -> Table:
    """Columns of numbered rows, the first of which is the header."""
    if not numbered:
        return Table(file, [], [], [], notes or {})
    header = ["" if cell is None else str(cell).strip() for cell in numbered[0][1]]
    _check_separator(file, header)
    width = len(header)
    for number, row in numbered[1:]:
        if len(row) < width or any(cell not in (None, "") for cell in row[width:]):
            raise TrialError(
                f"row {number} of {file} has {len(row)} cells, its header has {width}; complete "
                "the row, and write numbers with a decimal point (a decimal comma splits a cell)"
            )
    cells = [[row[index] for _, row in numbered[1:]] for index in range(width)]
    return Table(file, header, cells, [number for number, _ in numbered[1:]], notes or {})


def _check_separator(file: str, header: Sequence[str]) -> None:
    """Refuse the CSV of a spreadsheet whose country writes decimal commas."""
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if separator in header[0]:
            raise TrialError(
                f"{file} separates its columns by {name}, a trial's CSV takes commas between "
                "columns and points in numbers (1.5, not 1,5); export it so"
            )


def _digits(value: float) -> str:
    """Shortest text that reads back as the same double; nothing for NaN."""
    return "" if value != value else repr(value)


def _needed(module: str, file: str) -> ModuleType:
    """A library of the `files` extra."""
    try:
        return importlib.import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise TrialError(
            f'{package}, which {file} needs, is not installed: pip install "pma-gym[files]"'
        ) from None
