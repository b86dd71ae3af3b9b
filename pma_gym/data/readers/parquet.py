"""Parquet files: columns of numbers, dates and texts."""

import io
import json
from typing import Any

import numpy as np

from pma_gym.data.files.trial_formats import needed
from pma_gym.data.readers.table import PROVENANCE, Cells, Request, Table
from pma_gym.limits import check_limit

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def read(content: bytes, file: str, request: Request) -> list[Table]:
    """The table in a Parquet file; its first record counts as row 1.

    Texts are read in columns with a known name alone, for a text of megabytes may stand once in the
    file and in every row of the table.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names.
    Returns:
        One table.
    Raises:
        TrialError: pyarrow is missing.
        LimitError: beyond a limit.
    """
    needed("pyarrow", file)
    source = needed("pyarrow.parquet", file).ParquetFile(io.BytesIO(content))
    meta, schema = source.metadata, source.schema_arrow
    check_limit(file, "columns", meta.num_columns)
    check_limit(file, "rows", meta.num_rows)
    check_limit(file, "cells", meta.num_rows * meta.num_columns)
    leaves = [meta.schema.column(i).path for i in range(meta.num_columns)]
    kinds = {
        name: _kind(schema.field(i).type) if name in leaves else ""
        for i, name in enumerate(schema.names)
    }
    taken = [n for n, kind in kinds.items() if kind and (kind != "text" or request.is_known(n))]
    unpacked = sum(
        meta.row_group(group).column(leaves.index(name)).total_uncompressed_size
        for group in range(meta.num_row_groups)
        for name in taken
    )
    check_limit(file, "table_mib", unpacked / 2**20)
    table = source.read(columns=taken, use_threads=False)
    rows = table.num_rows if taken else 0
    cells = [
        _cells(table.column(name), kinds[name], request.is_time(name), file)
        if name in taken
        else [None] * rows
        for name in schema.names
    ]
    notes, said = _notes(schema.metadata or {}, file)
    dated = [n for n in taken if kinds[n] == "date" and request.is_time(n)]
    said += [f"{name} holds dates, converted to seconds from the first row" for name in dated]
    said += [
        f"{name!r} is passed over: its cells are of type {str(schema.field(i).type)[:60]}"
        for i, name in enumerate(schema.names)
        if not kinds[name]
    ]
    return [Table(file, schema.names, cells, range(1, rows + 1), notes, remarks=tuple(said))]


def _kind(type_: Any) -> str:  # noqa: ANN401
    """Kind of a column's content: "number", "flag", "date", "text"; empty for anything else."""
    types = needed("pyarrow.types", "")
    if types.is_dictionary(type_):
        return "text" if _kind(type_.value_type) == "text" else ""
    if types.is_integer(type_) or types.is_floating(type_) or types.is_decimal(type_):
        return "number"
    if types.is_timestamp(type_) or types.is_duration(type_) or types.is_time(type_):
        return "date"
    if types.is_boolean(type_):
        return "flag"
    return "text" if types.is_string(type_) or types.is_large_string(type_) else ""


def _cells(column: Any, kind: str, is_time: bool, file: str) -> Cells:  # noqa: ANN401
    """Cells of a column: an array of numbers, else a list."""
    pyarrow = needed("pyarrow", file)
    if kind == "number":
        return column.cast(pyarrow.float64(), safe=False).to_numpy()
    if kind == "flag":
        return column.to_pylist()
    if kind == "date":
        return _dates(column, is_time, file)
    cells: list[object] = []
    # Bytes first: not every text is one.
    for word in column.cast(pyarrow.string()).cast(pyarrow.large_binary()).to_pylist():
        check_limit(f"a cell of {file}", "cell_characters", len(word or b""))
        cells.append(None if word is None else word.decode("utf-8", "replace"))
    return cells


def _dates(column: Any, is_time: bool, file: str) -> Cells:  # noqa: ANN401
    """Seconds from the first row; texts where the column is not the time's."""
    pyarrow = needed("pyarrow", file)
    unit = _SECONDS[column.type.unit]
    wide = column.cast(pyarrow.int32()) if column.type.bit_width == 32 else column
    counts = wide.cast(pyarrow.int64()).to_pylist()
    if not is_time:
        return ["a date" if count is not None else None for count in counts]
    first = next((count for count in counts if count is not None), 0)
    # Whole numbers first: dates since 1970 leave a double half a microsecond.
    return np.array([np.nan if c is None else (c - first) * unit for c in counts])


def _notes(metadata: Any, file: str) -> tuple[dict[str, str], list[str]]:  # noqa: ANN401
    """Provenance in the file's metadata; what cannot be used of it is remarked."""
    packed = metadata.get(f"pma_gym.{PROVENANCE}".encode())
    if packed is None:
        return {}, []
    check_limit(f"the provenance of {file}", "document_kib", len(packed) / 1024)
    try:
        notes = json.loads(packed)
    except (ValueError, RecursionError):
        notes = None
    if not isinstance(notes, dict):
        return {}, ["its provenance is passed over, it is no JSON object"]
    flat = {k: v for k, v in notes.items() if isinstance(v, str | int | float | None)}
    said = [f"{len(notes) - len(flat)} entries of its provenance are passed over, they are no text"]
    return {k: "" if v is None else str(v) for k, v in flat.items()}, said * (
        len(flat) < len(notes)
    )
