"""A printed figure beside the same figure recomputed, and the verdict.

With h half a unit of the last printed digit and d the distance of the two figures:

- `equal`: d <= h. The recomputed figure, rounded as the printed one is, is the printed one.
- `rounded`: d <= h + r, where r is how far the rounding of the printed inputs moves the recomputed
  figure. For each input, c is the larger change that half a unit of its last printed digit makes,
  up or down. r is the sum of all c (the worst case) or sqrt(3 sum of c^2) (three standard
  deviations of independent, uniform rounding errors), whichever is smaller.
- `wrong in print`: anything else. The printed figure does not follow from the printed data.

Spreadsheets drop zeros at the end of a figure, and the tables here may carry `.0` where an integer
is printed, so `.0` does not count as a printed digit.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.data.serres2008 import load_table

Verdict = Literal["equal", "rounded", "wrong in print"]

VERDICTS: tuple[Verdict, ...] = ("equal", "rounded", "wrong in print")


@dataclass(frozen=True)
class Comparison:
    """One printed figure beside the recomputed one.

    Attributes:
        study: group of comparisons, such as "displacement trials".
        table: where it is printed, such as "21" or "Appendix C".
        quantity: which figure, in words, with its unit where it has one.
        printed: the figure as printed.
        recomputed: the figure as it follows from the data.
        verdict: see the module.
        note: what it was computed from, or what is wrong.
    """

    study: str
    table: str
    quantity: str
    printed: str
    recomputed: float
    verdict: Verdict
    note: str = ""


def half_unit(printed: str) -> float:
    """Half a unit of the last digit of a printed figure.

    >>> half_unit("0.0117"), half_unit("121.0"), half_unit("2.86e6")
    (5e-05, 0.5, 5000.0)
    """
    mantissa, _, exponent = printed.lower().partition("e")
    _, _, decimals = mantissa.removesuffix(".0").partition(".")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(decimals))


def half_units(printed: Iterable[str]) -> NDArray[np.float64]:
    """`half_unit` of each figure, shape (n,)."""
    return np.array([half_unit(text) for text in printed])


def verdict(printed: str, recomputed: float, reach: float = 0.0) -> Verdict:
    """The verdict on a printed figure; `<0.0001` is a bound.

    Args:
        printed: the figure as printed.
        recomputed: the figure as it follows from the data.
        reach: r of the module's rule.
    """
    if printed.startswith("<"):
        return "equal" if recomputed < float(printed[1:]) else "wrong in print"
    value = float(printed)
    # Figures that end in 5 are rounded up or down by the noise of floating point.
    slack = 1e-9 * abs(value)
    distance, half = abs(value - recomputed), half_unit(printed) + slack
    if distance <= half:
        return "equal"
    return "rounded" if distance <= half + reach else "wrong in print"


def rounding_reach(
    compute: Callable[[NDArray[np.float64]], ArrayLike], inputs: ArrayLike, halves: ArrayLike
) -> NDArray[np.float64]:
    """Bound the effect of the rounding of printed inputs on a computed result.

    Args:
        compute: from inputs, shape (n,), to figures, shape (m,).
        inputs: the printed inputs.
        halves: half a unit of each, shape (n,); 0 for inputs that are exact.

    Returns:
        r of the module's rule for each figure, shape (m,).
    """
    base, steps = np.asarray(inputs, dtype=float), np.asarray(halves, dtype=float)
    figures = np.asarray(compute(base), dtype=float)
    changes = []
    for index in np.flatnonzero(steps):
        moved = np.zeros_like(base)
        moved[index] = steps[index]
        up, down = np.asarray(compute(base + moved)), np.asarray(compute(base - moved))
        changes.append(np.maximum(np.abs(up - figures), np.abs(down - figures)))
    if not changes:
        return np.zeros_like(figures)
    worst, likely = np.sum(changes, axis=0), np.sqrt(3.0 * np.sum(np.square(changes), axis=0))
    return np.minimum(worst, likely)


def compare(
    place: tuple[str, str],
    quantities: Sequence[str],
    printed: Sequence[str],
    recomputed: ArrayLike,
    reach: ArrayLike = 0.0,
    note: str = "",
) -> list[Comparison]:
    """Comparisons of several figures of one table.

    Args:
        place: study and table.
        quantities: names, shape (m,).
        printed: figures as printed, shape (m,).
        recomputed: figures as they follow from the data, shape (m,).
        reach: r of the module's rule, shape (m,) or one for all.
        note: one for all.
    """
    values = np.asarray(recomputed, dtype=float)
    reaches = np.broadcast_to(np.asarray(reach, dtype=float), values.shape)
    rows = zip(quantities, printed, values, reaches, strict=True)
    return [
        Comparison(*place, name, text, float(value), verdict(text, float(value), float(r)), note)
        for name, text, value, r in rows
    ]


def compare_computed(
    place: tuple[str, str],
    quantities: Sequence[str],
    printed: Sequence[str],
    compute: Callable[[NDArray[np.float64]], ArrayLike],
    inputs: Sequence[str],
    note: str = "",
) -> list[Comparison]:
    """Comparisons of figures that follow from other printed figures.

    Args:
        place: study and table.
        quantities: names, shape (m,).
        printed: figures as printed, shape (m,).
        compute: from inputs, shape (n,), to figures, shape (m,).
        inputs: the printed figures to compute from, shape (n,).
        note: one for all.
    """
    values = np.array([float(text) for text in inputs])
    reach = rounding_reach(compute, values, half_units(inputs))
    return compare(place, quantities, printed, compute(values), reach, note)


_PER_UNIT = {"lb": 4.4482216152605, "psi": 6.894757293168}
"""Newtons in a pound of force, kilopascals in a pound per square inch."""


def compare_conversions() -> list[Comparison]:
    """Pounds and psi that the text gives beside newtons and kilopascals."""
    printed = load_table("conversions").printed
    rows: list[Comparison] = []
    columns = (printed[name] for name in ("section", "value", "unit", "printed", "printed_unit"))
    for section, value, unit, text, imperial in zip(*columns, strict=True):

        def compute(values: NDArray, factor: float = _PER_UNIT[imperial]) -> NDArray:
            return values / factor

        rows += compare_computed(
            ("conversions", f"section {section}"),
            [f"{value} {unit} in {imperial}"],
            [text],
            compute,
            [value],
        )
    return rows
