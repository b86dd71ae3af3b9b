"""The kinds of files that hold trials: which reader takes which, and the three that are written.

CSV is the format of a log and holds nothing but columns. Parquet keeps the provenance in its schema
metadata, XLSX on a second sheet.

Libraries of the `files` extra, which only some formats need.
"""

import csv
import importlib
import io
import json
import re
from collections.abc import Callable, Mapping
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.readers.delimited import read_text
from pma_gym.data.readers.reader_process import binary_reader
from pma_gym.data.readers.table import PROVENANCE, Request, Table, UnreadableError

__all__ = ["Columns", "DECODERS", "ENCODERS", "PROVENANCE", "Reader", "Table"]

_PACKAGES = {"nptdms": "npTDMS"}


def needed(module: str, file: str) -> ModuleType:
    """A library of the `files` extra.

    Raises:
        UnreadableError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        name = module.partition(".")[0]
        raise UnreadableError(
            f"{_PACKAGES.get(name, name)}, which {file} needs, is not installed: "
            'pip install "pma-gym[files]"'
        ) from None


Columns = Mapping[str, NDArray[np.float64]]
"""Values in files' units by column name; NaN = empty."""

Reader = Callable[[bytes, str, Request], list[Table]]
"""Takes bytes, the file's name and a request; gives the tables in them."""

_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff\ud800-\udfff]")
"""Characters that XML has no place for."""


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


def encode_parquet(columns: Columns, provenance: Mapping[str, str]) -> bytes:
    """A Parquet file with null for NaN and the provenance as JSON in the schema's metadata."""
    pyarrow, parquet = needed("pyarrow", ".parquet"), needed("pyarrow.parquet", ".parquet")
    arrays = {name: pyarrow.array(array, from_pandas=True) for name, array in columns.items()}
    metadata = {f"pma_gym.{PROVENANCE}": json.dumps(dict(provenance))}
    out = io.BytesIO()
    parquet.write_table(pyarrow.table(arrays).replace_schema_metadata(metadata), out)
    return out.getvalue()


def encode_xlsx(columns: Columns, provenance: Mapping[str, str]) -> bytes:
    """An XLSX file: sheets "trial" and, if there is any, "provenance"."""
    openpyxl, cells = needed("openpyxl", ".xlsx"), needed("openpyxl.cell", ".xlsx")
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("trial")
    sheet.append(list(columns))
    for row in zip(*(array.tolist() for array in columns.values()), strict=True):
        sheet.append([None if value != value else value for value in row])
    if provenance:
        notes = book.create_sheet(PROVENANCE)
        for item in provenance.items():
            row = [cells.WriteOnlyCell(notes, _UNPRINTABLE.sub("\ufffd", text)) for text in item]
            for cell in row:
                # Text that begins with = is text: a name from a stranger is no formula.
                cell.data_type = "s"
            notes.append(row)
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


DECODERS: dict[str, Reader] = {
    ".csv": read_text,
    ".txt": read_text,
    ".tsv": read_text,
    ".dat": read_text,
    ".lvm": read_text,
    ".parquet": binary_reader("parquet"),
    ".xlsx": binary_reader("xlsx"),
    ".xlsm": binary_reader("xlsx"),
    ".mat": binary_reader("matlab"),
    ".h5": binary_reader("hdf5"),
    ".hdf5": binary_reader("hdf5"),
    ".tdms": binary_reader("tdms"),
}
"""Reader of each kind of file, by suffix."""

ENCODERS: dict[str, Callable[[Columns, Mapping[str, str]], bytes]] = {
    ".csv": encode_csv,
    ".parquet": encode_parquet,
    ".xlsx": encode_xlsx,
}
"""Writer of each kind of file, by suffix."""


def _digits(value: float) -> str:
    """Shortest text that reads back as the same double; nothing for NaN."""
    return "" if value != value else repr(value)
