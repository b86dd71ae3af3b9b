"""MATLAB's MAT files: version 5 (`save`, `-v7`) is read here, 7.3 is HDF5.

Version 5 is parsed here because what an array declares is not to be trusted: a reader that
allocates by it takes gigabytes for a file of bytes. Source: The MathWorks, "MAT-File Format",
R2024a, chapter 1.
"""

import struct
import zlib
from collections.abc import Iterator

import numpy as np

from pma_gym.data.readers.hdf5 import SIGNATURE, read_hdf5
from pma_gym.data.readers.table import Request, Table, UnreadableError
from pma_gym.data.readers.variables import OPAQUE, Variable, tables_of
from pma_gym.limits import check_limit, limit

_NUMBERS = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
"""Types of data elements by number."""
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_NUMERIC = range(6, 16)
_FUNCTION, _OPAQUE = 16, 17
_HEADER = 128


class _Damaged(Exception):
    """Bytes that are no MAT file."""


def read_mat(content: bytes, file: str, request: Request = Request()) -> list[Table]:  # noqa: B008
    """The tables in a MAT file: vectors of one length, or the fields of its structures.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names.
    Returns:
        Tables, one a structure that holds any.
    Raises:
        TrialError: damaged, of version 4, a MATLAB table, or beyond a limit.
    """
    if SIGNATURE in content[:1024]:
        return read_hdf5(content, file, request)
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None or len(content) < _HEADER:
        raise UnreadableError(
            f"{file} is not a readable MAT file of version 5 or later; save it in MATLAB with "
            "save(file, '-v7')"
        )
    try:
        variables = dict(_variables(content[_HEADER:], order, file))
    except (_Damaged, struct.error, zlib.error, UnicodeError, RecursionError) as error:
        raise UnreadableError(
            f"{file} is not a readable MAT file: {error or type(error).__name__}; save it again"
        ) from None
    return tables_of(variables, file, request)


def _variables(content: bytes, order: str, file: str) -> Iterator[tuple[str, Variable]]:
    """Names and values of a file's variables."""
    at, unpacked = 0, 0
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        body = content[at + 8 : at + 8 + size]
        if len(body) < size:
            raise _Damaged("it is cut off")
        at += 8 + size
        if kind == _COMPRESSED:
            inner = _inflate(body, file, unpacked)
            unpacked += len(inner)
            if len(inner) < 8:
                raise _Damaged("a compressed variable is empty")
            kind, size = struct.unpack_from(f"{order}II", inner)
            body = inner[8 : 8 + size]
            if len(body) < size:
                raise _Damaged("a compressed variable is cut off")
        elif size % 8:
            at += 8 - size % 8
        if kind == _MATRIX and body:
            name, value = _matrix(body, order, 0, file)
            yield name, value


def _inflate(body: bytes, file: str, before: int) -> bytes:
    """Unpacked bytes, as long as they are within the limit."""
    most = limit("table_mib") * 2**20 - before
    inner = zlib.decompressobj().decompress(body, max(1, most + 1))
    check_limit(file, "table_mib", (before + len(inner)) / 2**20)
    return inner


class _Elements:
    """Takes data elements from bytes, one after the other."""

    def __init__(self, content: bytes, order: str) -> None:
        self._content, self._order, self._at = content, order, 0

    def take(self) -> tuple[int, bytes]:
        """Type and bytes of the next element."""
        content, at = self._content, self._at
        if at + 8 > len(content):
            raise _Damaged("a variable is cut off")
        (word,) = struct.unpack_from(f"{self._order}I", content, at)
        if word >> 16:
            # A small element: its bytes stand in the tag.
            kind, size, start, step = word & 0xFFFF, word >> 16, at + 4, 8
            if size > 4:
                raise _Damaged("a small element is too long")
        else:
            kind, size = struct.unpack_from(f"{self._order}II", content, at)
            start, step = at + 8, 8 + size + -size % 8
        body = content[start : start + size]
        if len(body) < size:
            raise _Damaged("a variable is cut off")
        self._at = at + step
        return kind, body

    def numbers(self) -> np.ndarray:
        """Numbers of the next element."""
        kind, body = self.take()
        if kind not in _NUMBERS:
            raise _Damaged(f"numbers of an unknown type, {kind}")
        dtype = np.dtype(self._order + _NUMBERS[kind])
        return np.frombuffer(body[: len(body) // dtype.itemsize * dtype.itemsize], dtype)


def _matrix(body: bytes, order: str, depth: int, file: str) -> tuple[str, Variable]:
    """Name and value of an array."""
    check_limit(file, "nesting", depth)
    elements = _Elements(body, order)
    flags = elements.numbers()
    if not flags.size:
        raise _Damaged("an array has no class")
    kind = int(flags[0]) & 0xFF
    if kind == _OPAQUE:
        return elements.take()[1].decode("ascii", "replace"), OPAQUE
    shape = [int(n) for n in elements.numbers()]
    if len(shape) < 2 or len(shape) > 32 or min(shape) < 0:
        raise _Damaged("an array has no shape")
    name = elements.take()[1].decode("ascii", "replace")
    count = 1
    for n in shape:
        count *= n
    check_limit(file, "cells", count)
    if kind in _NUMERIC:
        values = elements.numbers()
        if values.size != count:
            raise _Damaged(f"{name!r} has {values.size} numbers for {count}")
        return name, None if int(flags[0]) & 0x0800 else _array(values, shape)
    if kind in (_STRUCT, _OBJECT):
        if kind == _OBJECT:
            elements.take()
        return name, _structures(elements, count, order, depth, file)
    return name, None


def _array(values: np.ndarray, shape: list[int]) -> np.ndarray:
    return values.astype(np.float64).reshape(shape, order="F")


def _structures(
    elements: _Elements, count: int, order: str, depth: int, file: str
) -> list[dict[str, Variable]]:
    """A structure array: the fields of each of its elements."""
    width = elements.numbers()
    length = int(width[0]) if width.size else 0
    packed = elements.take()[1]
    if not 0 < length <= 4096:
        raise _Damaged("a structure has no names")
    names = [
        packed[i : i + length].split(b"\0")[0].decode("ascii", "replace")
        for i in range(0, len(packed) // length * length, length)
    ]
    check_limit(file, "columns", len(names))
    check_limit(file, "sheets", count)
    out: list[dict[str, Variable]] = []
    for _ in range(count):
        fields: dict[str, Variable] = {}
        for name in names:
            kind, body = elements.take()
            if kind != _MATRIX:
                raise _Damaged("a field is no array")
            fields[name] = _matrix(body, order, depth + 1, file)[1] if body else None
        out.append(fields)
    return out
