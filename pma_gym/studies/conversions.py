"""Conversions of units in the dissertation's text."""

from numpy.typing import NDArray

from pma_gym.data.serres2008 import load_table
from pma_gym.studies.comparison import Comparison, compare_computed

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

        place = ("conversions", f"section {section}")
        rows += compare_computed(place, [f"{value} {unit} in {imperial}"], [text], compute, [value])
    return rows
