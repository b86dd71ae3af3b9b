"""The header of a safetensors file, checked before the package takes memory for what it says."""

import math
from typing import Any

from pma_gym.document_shape import ListOf, Whole, check_shape
from pma_gym.documents import parse_json

BYTES = {
    "BOOL": 1,
    "U8": 1,
    "I8": 1,
    "I16": 2,
    "U16": 2,
    "F16": 2,
    "BF16": 2,
    "I32": 4,
    "U32": 4,
    "F32": 4,
    "F64": 8,
    "I64": 8,
    "U64": 8,
}
"""Bytes of a number, by its kind in the header."""

LARGEST_HEADER = 1 << 20
"""Most bytes of a header: names and shapes of some ten thousand tensors."""

MOST_DIMENSIONS = 8

_TENSOR = {
    "dtype": str,
    "shape": ListOf(Whole(0, 2**48)),
    "data_offsets": ListOf(Whole(0, 2**48), 2),
}


class TensorHeaderError(ValueError):
    """A file is no safetensors file, or its header disagrees with its contents."""


def check_header(start: bytes, size: int) -> dict[str, Any]:
    """What a safetensors file holds, by the names of its tensors.

    Args:
        start: its first `8 + LARGEST_HEADER` bytes, or all of a shorter one.
        size: of the file (bytes).
    Returns:
        The header: dtype, shape and data_offsets by name.
    Raises:
        ValueError: no header, or tensors that do not fill the file exactly.
    """
    length = int.from_bytes(start[:8], "little")
    if len(start) < 8 or length > LARGEST_HEADER or 8 + length > size:
        raise TensorHeaderError(
            f"its header must be at most {LARGEST_HEADER} bytes inside the file, it announces "
            f"{length} in {size}"
        )
    header = parse_json(start[8 : 8 + length], "its header")
    if not isinstance(header, dict):
        raise TensorHeaderError("its header must be an object of tensors by name")
    spans = []
    for name, entry in header.items():
        if name == "__metadata__":
            continue
        check_shape(entry, _TENSOR, f"tensor {name[:60]}")
        (begin, end), kind, shape = entry["data_offsets"], entry["dtype"], entry["shape"]
        wanted = BYTES.get(kind, 0) * math.prod(shape)
        if kind not in BYTES or len(shape) > MOST_DIMENSIONS or end - begin != wanted:
            raise TensorHeaderError(
                f"tensor {name[:60]} announces {kind[:20]!r} numbers of shape {shape[:9]} in "
                f"{end - begin} bytes, which do not fit"
            )
        spans.append((begin, end))
    filled = 0
    for begin, end in sorted(spans):
        if begin != filled:
            raise TensorHeaderError("its tensors overlap or leave gaps")
        filled = end
    if filled != size - 8 - length:
        raise TensorHeaderError(
            f"its tensors fill {filled} bytes, it has {size - 8 - length}: cut off or changed"
        )
    return header
