"""Numbers that loggers write where nothing was measured: -999, 9999, 1e30."""

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.readers.table import Table
from pma_gym.data.trial_columns import Source, TrialError

_MARKS = frozenset(
    {-6999.0, 7999.0, -7999.0, 8888.0, -8888.0, 32767.0, -32768.0, 65535.0}
    | {2147483647.0, -2147483648.0, 4294967295.0, -32767.0}
)
"""Marks of data loggers, and the ends of whole numbers."""

_VOID = 1e29
"""Smallest magnitude of which no sensor speaks."""
_FEW, _MOST = 0.2, 0.5
"""Largest share of a column that any number, and a known mark, takes as one."""
_FAR = 3.0
"""Spans of the other cells by which a known mark lies outside of them."""
_VERY_FAR = 10.0
"""The same for any other whole number that comes more than once."""
_LEAST = 90.0
"""Smallest magnitude of such a number."""
_LEAST = 10
"""Cells from which a column tells its bulk from a mark."""
_SHOWN = 5


def check_sentinels(source: Source, values: NDArray[np.float64], table: Table) -> None:
    """Refuse a column in which a few cells hold a mark for "not measured".

    A mark is a number far from all others in the column: of nines, the end of a whole number's
    range, or any whole number that comes more than once.

    Args:
        source: the column.
        values: its numbers as they stand in the file, NaN where a cell is empty.
        table: its file.
    Raises:
        TrialError: names the number, the cells and the fix.
    """
    mark = sentinel(values)
    if mark is None:
        return
    at = np.flatnonzero(values == mark)
    others = values[np.isfinite(values) & (values != mark)]
    rows = ", ".join(str(table.rows[int(i)]) for i in at[:_SHOWN])
    more = f" and {at.size - _SHOWN} more" if at.size > _SHOWN else ""
    raise TrialError(
        f"{source.name} of {table.file} is {mark:.10g} in row {rows}{more}, while its other cells "
        f"lie in {others.min():.6g} to {others.max():.6g}; it looks like a logger's mark for "
        "nothing measured: empty these cells, or, for all files at once, write "
        f"missing = [{mark:.17g}] under [format] of dataset.toml"
    )


def sentinel(values: NDArray[np.float64]) -> float | None:
    """The number in a column that stands for "not measured"; None if none does.

    Example:
        >>> sentinel(np.array([23.8, 23.9, -999.0, 24.0, 23.7, -999.0, 24.1, 24.2, 24.0, 23.9]))
        -999.0
    """
    finite = values[np.isfinite(values)]
    if finite.size < _LEAST:
        return None
    for extreme in (float(finite.min()), float(finite.max())):
        others = finite[finite != extreme]
        count = finite.size - others.size
        share = _MOST if _known(extreme) else _FEW
        if not others.size or count > max(1.0, share * finite.size):
            continue
        low, high = float(others.min()), float(others.max())
        if _known(extreme):
            bulk = _bulk(others)
            if _away(extreme, *bulk) > _FAR * max(bulk[1] - bulk[0], 1e-9 * abs(extreme)):
                return extreme
        elif (
            count > 1
            and extreme.is_integer()
            and abs(extreme) >= _LEAST
            and _away(extreme, low, high) > _VERY_FAR * (high - low) > 0.0
        ):
            return extreme
    return None


def _known(value: float) -> bool:
    """Whether a number is written as a mark: nines alone, or an end of whole numbers."""
    digits = f"{abs(value):.10g}".replace(".", "").rstrip("0")
    nines = len(digits) >= 3 and set(digits) == {"9"} and abs(value) >= 99.0
    return nines or value in _MARKS or abs(value) >= _VOID


def _bulk(values: NDArray[np.float64]) -> tuple[float, float]:
    """Where the cells lie that are no marks: a second mark does not widen it."""
    plain = np.array([value for value in np.unique(values) if not _known(float(value))])
    if not plain.size:
        plain = values
    return float(plain.min()), float(plain.max())


def _away(value: float, low: float, high: float) -> float:
    """Distance of a number from a range."""
    return max(low - value, value - high, 0.0)
