"""Headers of a Parquet file's pages: how much each unpacks to, before it is unpacked.

Source: Apache Parquet, `parquet.thrift`, `PageHeader`; Apache Thrift, compact protocol.
"""

from collections.abc import Iterator
from dataclasses import dataclass

DELTA_BYTE_ARRAY = 7
"""Encoding in which a text is the beginning of the one before and an end of its own."""

_STRUCT, _LIST, _SET, _MAP = 12, 9, 10, 11
_DEEPEST = 8
_LONGEST = 1 << 16
"""Entries of a list in a page header, at most."""


@dataclass(frozen=True)
class Page:
    """A page.

    Attributes:
        unpacked: bytes that it unpacks to.
        encoding: number of its values' encoding; -1 for one without values.
    """

    unpacked: int
    encoding: int


def read_pages(content: bytes, start: int, size: int) -> Iterator[Page]:
    """The pages of a column in a row group.

    Args:
        content: bytes of the file.
        start: of the first page's header.
        size: bytes of all the pages.
    Raises:
        ValueError: they are not in the file, or no page headers.
    """
    at, end = start, start + size
    if not 0 <= start <= end <= len(content):
        raise ValueError("a column lies outside of the file")
    while at < end:
        fields, at = _struct(content, at, 0)
        unpacked, packed = fields.get(2), fields.get(3)
        if (
            not isinstance(unpacked, int)
            or not isinstance(packed, int)
            or min(unpacked, packed) < 0
        ):
            raise ValueError("a page header is damaged")
        values = fields.get(5) or fields.get(7) or fields.get(8) or {}
        key = 4 if 8 in fields and 5 not in fields else 2
        encoding = values.get(key, -1) if isinstance(values, dict) else -1
        yield Page(unpacked, encoding if isinstance(encoding, int) else -1)
        at += packed


_Value = int | dict[int, "_Value"] | None


def _struct(content: bytes, at: int, depth: int) -> tuple[dict[int, _Value], int]:
    """Fields of a struct by number, and where it ends."""
    if depth > _DEEPEST:
        raise ValueError("a page header is nested too deep")
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
    """A field's value, None for what no page needs."""
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
        return None, at + length
    if kind == _STRUCT:
        return _struct(content, at, depth + 1)
    if kind in (_LIST, _SET):
        head, at = _byte(content, at)
        count = head >> 4
        if count == 15:
            count, at = _varint(content, at)
        if count > _LONGEST:
            raise ValueError("a list in a page header is too long")
        for _ in range(count):
            inner = head & 15
            _, at = _byte(content, at) if inner in (1, 2) else _value(content, at, inner, depth + 1)
        return None, at
    raise ValueError("a page header is damaged")


def _byte(content: bytes, at: int) -> tuple[int, int]:
    if at >= len(content):
        raise ValueError("a page header is cut off")
    return content[at], at + 1


def _varint(content: bytes, at: int) -> tuple[int, int]:
    number = 0
    for shift in range(0, 70, 7):
        byte, at = _byte(content, at)
        number |= (byte & 127) << shift
        if byte < 128:
            return number, at
    raise ValueError("a number in a page header is too long")


def _zigzag(content: bytes, at: int) -> tuple[int, int]:
    number, at = _varint(content, at)
    return (number >> 1) ^ -(number & 1), at
