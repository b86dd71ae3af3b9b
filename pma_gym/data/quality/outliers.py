"""A few readings far from all others: named by their cells, and no unit is guessed from them."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial_columns import BY_QUANTITY, TrialError

LARGEST = {"contraction": 250.0, "pressure": 5000.0, "pressure_command": 5000.0}
"""Magnitude (mm, kPa, kPa) beyond which no muscle of this kind goes."""

_FEW = 0.01
"""Largest share of readings that are outliers."""
_FAR = 10.0
"""Spans of the others by which an outlier lies outside of them."""
_LEAST = 20
_SHOWN = 5

Values = Mapping[str, NDArray[np.float64]]


def check_possible(values: Values, quantity: str, place: Callable[[int], str]) -> None:
    """Refuse readings that no muscle gives.

    Args:
        values: by quantity, in the unit of files.
        quantity: which of them; others than those of `LARGEST` have no bound.
        place: where a sample stands.
    Raises:
        TrialError: names the cells and the fix.
    """
    if quantity not in values or quantity not in LARGEST:
        return
    beyond = np.flatnonzero(np.abs(values[quantity]) > LARGEST[quantity])
    if not beyond.size:
        return
    column = BY_QUANTITY[quantity]
    raise TrialError(
        f"{column.name} is {values[quantity][beyond[0]]:.6g} {column.unit} in "
        f"{_places(beyond, place)}, beyond the {LARGEST[quantity]:g} {column.unit} that a muscle "
        "reaches, while the other readings are not; empty these cells if nothing was measured there"
    )


def outliers(values: Values, place: Callable[[int], str]) -> Iterator[str]:
    """Words on readings that lie far from all others of their signal."""
    for quantity, all_values in values.items():
        finite = np.flatnonzero(np.isfinite(all_values))
        if finite.size < _LEAST:
            continue
        readings = all_values[finite]
        low, high = np.quantile(readings, [_FEW, 1.0 - _FEW], method="nearest")
        away = np.maximum(low - readings, readings - high)
        at = finite[away > _FAR * (high - low)]
        if not at.size or high == low or at.size > max(1.0, _FEW * finite.size):
            continue
        # A short pulse is a signal; it lasts longer than a reading.
        if np.any(np.diff(at) == 1):
            continue
        column = BY_QUANTITY[quantity]
        yield (
            f"{column.name} is {all_values[at[0]]:.6g} {column.unit} in {_places(at, place)}, far "
            f"from its other readings, {low:.4g} to {high:.4g}; empty these cells if nothing was "
            "measured there"
        )


def _places(at: NDArray[np.intp], place: Callable[[int], str]) -> str:
    shown = ", ".join(place(int(i)).partition(" of ")[0] for i in at[:_SHOWN])
    return f"{shown} and {at.size - _SHOWN} more" if at.size > _SHOWN else shown
