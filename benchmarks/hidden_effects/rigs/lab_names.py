"""A lab's own names and units of columns, which its dataset.toml leads back to ours."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class LabNames:
    """A lab's names of columns: ours = factor * theirs.

    Attributes:
        time: name of the time.
        second: seconds of its unit.
        columns: name and factor by our name; where one is missing it has our name.
    """

    time: str = "time_s"
    second: float = 1.0
    columns: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def of(self, column: str) -> tuple[str, float]:
        """Name and factor of a column."""
        return self.columns.get(column, (column, 1.0))

    def decimals(self, column: str, places: int) -> int:
        """Of values that have so many in our unit."""
        _, factor = self.of(column)
        return max(0, places + math.ceil(math.log10(abs(factor))))

    def lines(self, columns: list[str]) -> list[str]:
        """Of dataset.toml."""
        if self == LabNames():
            return []
        lines = ["", "[columns]", f'{self.time} = {{ name = "time_s", factor = {self.second:g} }}']
        for ours in columns:
            name, factor = self.of(ours)
            lines.append(f'{name} = {{ name = "{ours}", factor = {factor:g} }}')
        return lines


OURS = LabNames()

METRES = LabNames(
    "t", 1.0, {"load_command_n": ("F_drive", -1.0), "contraction_mm": ("x_m", 1000.0)}
)
"""SI, with a force that is positive where the position grows."""

GERMAN = LabNames(
    "Zeit_ms",
    0.001,
    {"load_command_n": ("Kraft_kN", 1000.0), "contraction_mm": ("Weg_um", 0.001)},
)


def draw_names(rng: np.random.Generator) -> LabNames:
    """Ours in three of five labs."""
    return (OURS, OURS, OURS, METRES, GERMAN)[int(rng.integers(5))]
