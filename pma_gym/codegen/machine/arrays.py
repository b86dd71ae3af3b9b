"""Memory layout of NumPy's array object, for compiled code.

The offsets of its first members are the same since NumPy 1.0, and every compiled extension uses
them. `are_known` checks them on test arrays; if they differ, compiled code does not use them.
"""

import ctypes
from functools import cache

import numpy as np

DIMENSIONS, SIZES, STRIDES, DATA, DTYPE, TYPE = 24, 32, 40, 16, 56, 8
"""Byte offsets in an array object of its number of dimensions, sizes, strides, data address, dtype
and type, in 64-bit CPython."""

_END = 64


@cache
def are_known() -> bool:
    """Whether arrays have this layout."""
    # No member is looked at beyond an object's end.
    if np.ndarray.__basicsize__ < _END or ctypes.sizeof(ctypes.c_void_p) != 8:
        return False
    return all(map(_is_known, (np.zeros(3), np.zeros((4, 2), np.float32)[::2])))


def _is_known(array: np.ndarray) -> bool:
    begin = id(array)

    def pointer(place: int) -> int | None:
        return ctypes.c_void_p.from_address(begin + place).value

    if (pointer(TYPE), pointer(DTYPE)) != (id(type(array)), id(array.dtype)):
        return False
    if pointer(DATA) != array.ctypes.data:
        return False
    if ctypes.c_int.from_address(begin + DIMENSIONS).value != array.ndim:
        return False
    pointers = [pointer(SIZES), pointer(STRIDES)]
    return None not in pointers and all(
        tuple((ctypes.c_int64 * array.ndim).from_address(at or 0)) == known
        for at, known in zip(pointers, (array.shape, array.strides), strict=True)
    )
