"""Named arrays of a file (MAT, HDF5) to tables: vectors of one length, or fields of structures."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from pma_gym.data.readers.table import PART, Request, Table, UnreadableError, ranges
from pma_gym.limits import check_limit


@dataclass(frozen=True)
class Unread:
    """A variable that is passed over, and what it is."""

    what: str


Variable: TypeAlias = "np.ndarray | Sequence[Mapping[str, Variable]] | Unread | None"
"""Numbers; the elements of a structure array; what is passed over; no vector at all."""

_INTO = "in MATLAB: S = timetable2table(TT); S.(1) = seconds(S.(1) - S.(1)(1)); "
_TABLE = "writetable(S, 'trial.csv')"
OPAQUE = Unread(
    "a table, timetable or object of MATLAB, whose form in a file is not published; write a CSV "
    f"file {_INTO}{_TABLE} (for a table T: writetable(T, 'trial.csv'))"
)
"""What a variable is that its format hides, and what to do."""

NUMBERS = "fiub"
"""Kinds of NumPy's types that are read."""
_KINDS = {"c": "complex numbers", "S": "texts", "U": "texts", "O": "texts or references"}


def array_of(values: np.ndarray) -> Variable:
    """An array as a variable: its numbers or, of other values, what they are."""
    if values.dtype.kind in NUMBERS:
        return np.asarray(values, dtype=np.float64)
    return unread(values.dtype) if values.size > 1 else None


def unread(dtype: np.dtype) -> Unread:
    """What values of a type are that are no numbers."""
    return Unread(_KINDS.get(dtype.kind, "no numbers"))


def tables_of(variables: Mapping[str, Variable], file: str, request: Request) -> list[Table]:
    """Tables of a file's variables.

    Args:
        variables: by name.
        file: its name, for messages.
        request: known names, and those of a matrix's columns.
    Returns:
        One table for the variables themselves, if they are one, and one for each structure; every
        vector that none of them has is remarked.
    Raises:
        UnreadableError: nothing is a table; the message lists the content and a remedy.
    """
    tables: list[Table] = []
    remarks: list[str] = []
    for part, columns in _groups("", variables, 0, file):
        table, others = _table(part, columns, file, request)
        said = [f"{name!r} is passed over: {what}" for name, what in others.items()]
        if table is None:
            remarks += said
        else:
            tables.append(replace(table, remarks=tuple(said)))
    if not tables:
        hidden = [name for name, value in variables.items() if value is OPAQUE]
        if hidden:
            raise UnreadableError(f"{file}: {hidden[0]!r} is {OPAQUE.what}")
        names = ", ".join(map(repr, list(variables)[:10])) or "nothing"
        raise UnreadableError(
            f"{file} holds {names}, but no vectors of one length with a name each; save time_s and "
            "each signal as a vector, or give a matrix's columns names in dataset.toml: "
            f"[format] names = ['time_s', ...]{_matrices(variables)}"
        )
    tables[0] = replace(tables[0], remarks=(*tables[0].remarks, *remarks))
    if len(tables) == 1:
        return [replace(tables[0], file=file)]
    return tables


def _matrices(variables: Mapping[str, Variable]) -> str:
    """What the columns of matrices hold."""
    shown = [
        f"; in {name!r} {ranges(value.T)}"
        for name, value in variables.items()
        if isinstance(value, np.ndarray) and value.ndim == 2 and value.dtype.kind in "fiu"
    ]
    return "".join(shown[:5])


def _groups(
    prefix: str, variables: Mapping[str, Variable], depth: int, file: str
) -> Iterator[tuple[str, Mapping[str, Variable]]]:
    """Name and members of the file itself and of every structure in it."""
    check_limit(file, "nesting", depth)
    yield prefix, variables
    for name, value in variables.items():
        if not isinstance(value, Sequence):
            continue
        path = f"{prefix}.{name}" if prefix else name
        for index, fields in enumerate(value, start=1):
            part = f"{path}_{index}" if len(value) > 1 else path
            yield from _groups(part, fields, depth + 1, file)


def _table(
    part: str, columns: Mapping[str, Variable], file: str, request: Request
) -> tuple[Table | None, dict[str, str]]:
    """The table of vectors of one length, None if there are not two; what the others are."""
    columns = _with_matrix(columns, request.format.names)
    vectors = {
        name: value.reshape(-1)
        for name, value in columns.items()
        if isinstance(value, np.ndarray) and 2 <= value.size == max(value.shape)
    }
    lengths = [vector.size for vector in vectors.values()]
    time = next((name for name in vectors if request.is_time(name)), None)
    size = vectors[time].size if time else max(lengths, key=lengths.count, default=0)
    taken = {name: vector for name, vector in vectors.items() if vector.size == size}
    if len(taken) < 2:
        taken = {}
    check_limit(file, "columns", len(taken))
    others = {
        f"{part}.{name}" if part else name: what
        for name, value in columns.items()
        if name not in taken and (what := _what(value, size if taken else None))
    }
    if not taken:
        return None, others
    label = f"{file}{PART}{part}" if part else file
    return Table(label, list(taken), list(taken.values()), range(1, size + 1), part=part), others


def _what(value: Variable, rows: int | None) -> str:
    """Why a value is no column; empty for single numbers and structures."""
    if isinstance(value, Unread):
        return value.what
    if not isinstance(value, np.ndarray) or value.size < 2:
        return ""
    if value.size != max(value.shape):
        return f"a matrix of {' x '.join(map(str, value.shape))}, whose columns have no names"
    return f"{value.size} values " + (f"for {rows} rows" if rows else "without a time beside them")


def _with_matrix(columns: Mapping[str, Variable], names: Sequence[str]) -> Mapping[str, Variable]:
    """The variables with the columns of the one matrix that has as many as there are names."""
    fitting = {
        name: value
        for name, value in columns.items()
        if isinstance(value, np.ndarray) and value.ndim == 2 and value.shape[1] == len(names)
    }
    if not names or len(fitting) != 1:
        return columns
    ((matrix, values),) = fitting.items()
    named = {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}
    return {name: value for name, value in columns.items() if name != matrix} | named
