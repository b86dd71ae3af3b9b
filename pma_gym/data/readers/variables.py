"""Named arrays of a file (MAT, HDF5) to tables: vectors of one length, or fields of structures."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from pma_gym.data.readers.table import PART, Request, Table, UnreadableError, ranges
from pma_gym.limits import check_limit

Variable: TypeAlias = "np.ndarray | Sequence[Mapping[str, Variable]] | str | None"
"""Numbers; the elements of a structure array; why something cannot be read; anything else."""

_INTO = "in MATLAB: S = timetable2table(TT); S.(1) = seconds(S.(1) - S.(1)(1)); "
_TABLE = "writetable(S, 'trial.csv')"
OPAQUE = (
    "a table, timetable or object of MATLAB, whose form in a file is not published; write a CSV "
    f"file {_INTO}{_TABLE} (for a table T: writetable(T, 'trial.csv'))"
)
"""What a variable is that its format hides, and what to do."""


def tables_of(variables: Mapping[str, Variable], file: str, request: Request) -> list[Table]:
    """Tables of a file's variables.

    Args:
        variables: by name.
        file: its name, for messages.
        request: known names, and those of a matrix's columns.
    Returns:
        One table for the variables themselves, if they are one, and one for each structure.
    Raises:
        UnreadableError: nothing is a table; the message lists the content and a remedy.
    """
    groups = [(part, columns) for part, columns in _groups("", variables, 0, file)]
    tables = [
        table
        for part, columns in groups
        if (table := _table(part, columns, file, request)) is not None
    ]
    if not tables:
        hidden = [name for name, value in variables.items() if isinstance(value, str)]
        if hidden:
            raise UnreadableError(f"{file}: {hidden[0]!r} is {OPAQUE}")
        names = ", ".join(map(repr, list(variables)[:10])) or "nothing"
        raise UnreadableError(
            f"{file} holds {names}, but no vectors of one length with a name each; save time_s and "
            "each signal as a vector, or give a matrix's columns names in dataset.toml: "
            f"[format] names = ['time_s', ...]{_matrices(variables)}"
        )
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
) -> Iterator[tuple[str, dict[str, Variable]]]:
    """Name and members of the file itself and of every structure in it."""
    check_limit(file, "nesting", depth)
    yield prefix, dict(_flat(variables))
    for name, value in variables.items():
        if isinstance(value, str) or value is None or isinstance(value, np.ndarray):
            continue
        path = f"{prefix}.{name}" if prefix else name
        for index, fields in enumerate(value, start=1):
            part = f"{path}_{index}" if len(value) > 1 else path
            yield from _groups(part, fields, depth + 1, file)


def _flat(variables: Mapping[str, Variable]) -> Iterator[tuple[str, Variable]]:
    yield from variables.items()


def _vector(value: Variable) -> np.ndarray | None:
    """An array's numbers, if it is a vector."""
    if not isinstance(value, np.ndarray) or value.size < 2 or value.size != max(value.shape):
        return None
    return value.reshape(-1)


def _table(part: str, columns: Mapping[str, Variable], file: str, request: Request) -> Table | None:
    """The table of vectors of one length; None if there are not two."""
    vectors = {name: v for name, value in columns.items() if (v := _vector(value)) is not None}
    if request.format.names:
        vectors |= _named_matrix(columns, request.format.names)
    lengths = [vector.size for vector in vectors.values()]
    time = next((name for name in vectors if request.is_time(name)), None)
    size = vectors[time].size if time else max(lengths, key=lengths.count, default=0)
    taken = {name: vector for name, vector in vectors.items() if vector.size == size}
    if len(taken) < 2:
        return None
    check_limit(file, "columns", len(taken))
    others = [
        name
        for name, value in columns.items()
        if name not in taken and isinstance(value, np.ndarray) and value.size > 1
    ]
    remarks = (
        (f"{', '.join(map(repr, others[:5]))} of another size than the time is passed over",)
        if others and not request.format.names
        else ()
    )
    label = f"{file}{PART}{part}" if part else file
    return Table(
        label, list(taken), list(taken.values()), range(1, size + 1), part=part, remarks=remarks
    )


def _named_matrix(columns: Mapping[str, Variable], names: Sequence[str]) -> dict[str, np.ndarray]:
    """Columns of the one matrix that has as many as there are names."""
    fitting = [
        value
        for value in columns.values()
        if isinstance(value, np.ndarray) and value.ndim == 2 and value.shape[1] == len(names)
    ]
    if len(fitting) != 1:
        return {}
    return {name: np.ascontiguousarray(fitting[0][:, i]) for i, name in enumerate(names)}
