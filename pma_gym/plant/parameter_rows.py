"""Parameters of a model for display and as TOML: value, interval, unit and source."""

import json
from dataclasses import dataclass
from typing import NamedTuple

from pma_gym.effects.effect import Value

LINE_FORM = (
    'a line is a table, [effect], or name = value, the value a number 1.5, a text "in quotes" or '
    '{ value = 1.5, source = "where from" }'
)
"""Expected form of a line of a model file, for messages."""


def toml_text(value: str | Value) -> str:
    """Convert a value to TOML text.

    >>> toml_text("50 %"), toml_text((1.0, 0.1 + 0.2))
    ('"50 %"', '[1, 0.3]')
    """
    if isinstance(value, str):
        # The escapes of JSON are those of TOML.
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, tuple):
        return "[" + ", ".join(toml_text(one) for one in value) + "]"
    # Nine digits: below every interval, and free of the last bits that unit factors leave.
    return f"{value:.9g}"


@dataclass(frozen=True)
class Note:
    """Source and interval of a parameter's value, in file units.

    Attributes:
        source: where the value comes from.
        low: lower end of its 95 % interval, or None.
        high: upper end, or None.
    """

    source: str = ""
    low: float | None = None
    high: float | None = None


class ParameterRow(NamedTuple):
    """A parameter for display.

    Attributes:
        effect: its effect.
        parameter: its name, without unit.
        value: value in `unit`; several numbers for a row.
        low: lower end of its 95 % interval, or None.
        high: upper end, or None.
        unit: unit in files.
        source: where the value comes from.
    """

    effect: str
    parameter: str
    value: Value
    low: float | None
    high: float | None
    unit: str
    source: str

    @property
    def value_text(self) -> str:
        """The value in six digits."""
        values = self.value if isinstance(self.value, tuple) else (self.value,)
        return ", ".join(f"{value:.6g}" for value in values)

    @property
    def interval_text(self) -> str:
        """The interval in four digits; empty where there is none."""
        if self.low is None or self.high is None:
            return ""
        return f"{self.low:.4g} to {self.high:.4g}"
