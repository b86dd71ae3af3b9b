"""Headers of a Parquet file's pages: how much each unpacks to, before it is unpacked.

pyarrow unpacks by what the pages declare, and its own description of a damaged file may end the
process. Source: Apache Parquet, `parquet.thrift`; Apache Thrift, compact schedule.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

DELTA_BYTE_ARRAY = 7
"""Encoding in which a text is the beginning of the one before and an end of its own."""

_STRUCT, _LIST, _SET = 12, 9, 10
_DEEPEST = 12
_LONGEST = 100_000
"""Entries of a list, at most."""
_SHORTEST = 8
"""Bytes of the shortest page header."""
_MAGIC = b"PAR1"


_Value: TypeAlias = "int | bytes | dict[int, _Value] | list[_Value] | None"


@dataclass(frozen=True)
class Page:
    """A page.

    Attributes:
        unpacked: bytes that it unpacks to.
        encoding: number of its values' encoding; -1 for one without values.
    """

    unpacked: int
    encoding: int


def read_pages(content: bytes) -> Iterator[tuple[int, Page]]:
    """The pages of a file, each with the position of its column.

    Args:
        content: bytes of the file.
    Raises:
        ValueError: it is no Parquet file, or its pages are not at the stated place.
    """
    if len(content) < 12 or content[-4:] != _MAGIC:
        raise ValueError("it does not end as a Parquet file does")
    start = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    if start < 4:
        raise ValueError("its description is cut off")
    footer, _ = _struct(content, start, 0)
    pages = 0
    for group in _listed(footer.get(4)):
        for index, chunk in enumerate(_listed(_fields(group).get(1))):
            meta = _fields(_fields(chunk).get(3))
            begin = min(_places(meta, (9, 11)), default=-1)
            for page in _chunk_pages(content, begin, next(_places(meta, (7,)), -1)):
                # Columns that share pages could have them read without end.
                pages += 1
                if pages > len(content) // _SHORTEST:
                    raise ValueError("its columns lie upon each other")
                yield index, page


def _places(meta: dict[int, "_Value"], keys: tuple[int, ...]) -> Iterator[int]:
    """Numbers of a description that are not 0."""
    for key in keys:
        value = meta.get(key)
        if isinstance(value, int) and value:
            yield value


def _listed(value: "_Value") -> list["_Value"]:
    return value if isinstance(value, list) else []


def _fields(value: "_Value") -> dict[int, "_Value"]:
    return value if isinstance(value, dict) else {}


def _chunk_pages(content: bytes, start: int, size: int) -> Iterator[Page]:
    """The pages of a column in a row group."""
    at, end = start, start + size
    if not 0 <= start <= end <= len(content):
        raise ValueError("a column lies outside of the file")
    while at < end:
        fields, at = _struct(content, at, 0)
        unpacked, packed = fields.get(2), fields.get(3)
        if not isinstance(unpacked, int) or not isinstance(packed, int):
            raise ValueError("a page header is damaged")
        if unpacked < 0 or packed < 0:
            raise ValueError("a page header declares a negative size")
        version_2 = 8 in fields and 5 not in fields
        values = _fields(fields.get(5) or fields.get(7) or fields.get(8))
        encoding = values.get(4 if version_2 else 2, -1)
        yield Page(unpacked, encoding if isinstance(encoding, int) else -1)
        at += packed


def _struct(content: bytes, at: int, depth: int) -> tuple[dict[int, _Value], int]:
    """Fields of a struct by number, and where it ends."""
    if depth > _DEEPEST:
        raise ValueError("it is nested too deep")
    fields: dict[int, _Value] = {}
    number = 0
    while True:
        head, at = _byte(content, at)
        if head == 0:
            return fields, at
        if head >> 4:
            number += head >> 4
        else:
            number, at = _zigzag(content, at)
        fields[number], at = _value(content, at, head & 15, depth)


def _value(content: bytes, at: int, kind: int, depth: int) -> tuple[_Value, int]:
    """A field's value; None for what is not needed."""
    if kind in (1, 2):
        return int(kind == 1), at
    if kind == 3:
        return _byte(content, at)
    if kind in (4, 5, 6):
        return _zigzag(content, at)
    if kind == 7:
        return None, at + 8
    if kind == 8:
        length, at = _varint(content, at)
        return content[at : at + length], at + length
    if kind == _STRUCT:
        return _struct(content, at, depth + 1)
    if kind in (_LIST, _SET):
        head, at = _byte(content, at)
        count = head >> 4
        if count == 15:
            count, at = _varint(content, at)
        if count > _LONGEST:
            raise ValueError("a list is too long")
        entries: list[_Value] = []
        for _ in range(count):
            inner = head & 15
            plain = inner in (1, 2)
            entry, at = _byte(content, at) if plain else _value(content, at, inner, depth + 1)
            entries.append(entry)
        return entries, at
    raise ValueError("a page header is damaged")


def _byte(content: bytes, at: int) -> tuple[int, int]:
    if at >= len(content):
        raise ValueError("it is cut off")
    return content[at], at + 1


def _varint(content: bytes, at: int) -> tuple[int, int]:
    number = 0
    for shift in range(0, 70, 7):
        byte, at = _byte(content, at)
        number |= (byte & 127) << shift
        if byte < 128:
            return number, at
    raise ValueError("a number is too long")


def _zigzag(content: bytes, at: int) -> tuple[int, int]:
    number, at = _varint(content, at)
    return (number >> 1) ^ -(number & 1), at
