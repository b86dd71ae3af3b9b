"""Parameters of a model as people read them: value, interval, unit and source."""

from dataclasses import dataclass
from typing import NamedTuple

from pma_gym.effects.effect import Value


@dataclass(frozen=True)
class Note:
    """What is known about a parameter's value, in its unit in files.

    Attributes:
        source: where the value comes from.
        low: lower end of its 95 % interval, or None.
        high: upper end, or None.
    """

    source: str = ""
    low: float | None = None
    high: float | None = None


class ParameterRow(NamedTuple):
    """A parameter as people read it.

    Attributes:
        effect: that it belongs to.
        parameter: its name, without unit.
        value: in `unit`; several numbers of a table.
        low: lower end of its 95 % interval, or None.
        high: upper end, or None.
        unit: in files.
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
