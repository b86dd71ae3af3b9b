"""Option values as plain Python: numbers of NumPy, arrays, ranges and paths survive JSON then."""

import numbers
from collections.abc import Iterable, Iterator, Mapping, Set
from enum import Enum
from pathlib import PurePath
from typing import Any

import numpy as np

WHOLE_BATCH = ("pressure_kpa", "pressures_kpa")
"""Options that may be a sequence: any iterable of numbers is taken as a list."""


def plain_options(given: Mapping[str, Any]) -> dict[str, Any]:
    """Keyword arguments of an environment with plain Python values, which JSON can hold.

    What has no plain form (a Model, a Task, a function) and what is no valid value stays, for the
    check of that option to accept or to quote.

    >>> plain_options({"preview": np.int64(2), "pressure_kpa": range(200, 301, 50), "noise": True})
    {'preview': 2, 'pressure_kpa': [200, 250, 300], 'noise': True}
    """
    return {
        name: plain_sequence(value) if name in WHOLE_BATCH else plain_scalar(value)
        for name, value in given.items()
    }


def plain_scalar(value: Any) -> Any:  # noqa: ANN401
    """A number, truth, text, path or member of an enumeration as Python's own; others unchanged.

    A NumPy array without dimensions is the number in it. A truth never becomes a number.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, str):
        return str(value)
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, numbers.Integral):
        return int(value)
    return float(value) if isinstance(value, numbers.Real) else value


def plain_sequence(value: Any) -> Any:  # noqa: ANN401
    """An iterable as a list of plain values, rows of a table as lists in it; others as scalars.

    A mapping and a set are no sequences: they have no order of numbers to draw from. Nor is an
    iterator, which is empty once it was read.
    """
    scalar = plain_scalar(value)
    if not isinstance(scalar, Iterable) or isinstance(
        scalar, str | bytes | Iterator | Mapping | Set
    ):
        return scalar
    return [plain_sequence(one) for one in scalar]
