"""Units in files: SI inside, a unit in every name outside.

Files, plots and messages use the units that people of this field read (mm, N, kPa, s, deg, V);
the code computes in SI. `Quantity` joins the two for one physical parameter.

Decimal numbers in text: one strict grammar for every reader.
"""

import math
import re
from dataclasses import dataclass
from functools import cache

SI_FACTORS: dict[str, float] = {
    "1": 1.0,
    "%": 0.01,
    "V": 1.0,
    "s": 1.0,
    "ms": 1e-3,
    "Hz": 1.0,
    "kg": 1.0,
    "m": 1.0,
    "mm": 1e-3,
    "um": 1e-6,
    "in": 0.0254,
    "mm^2": 1e-6,
    "cm^3": 1e-6,
    "l": 1e-3,
    "l/min/bar": 1e-8 / 60.0,
    "deg": math.pi / 180.0,
    "rad": 1.0,
    "N": 1.0,
    "kN": 1e3,
    "lbf": 4.4482216152605,
    "kip": 4448.2216152605,
    "N m": 1.0,
    "N or N m": 1.0,
    "Pa": 1.0,
    "kPa": 1e3,
    "bar": 1e5,
    "1/kPa": 1e-3,
    "1/mm": 1e3,
    "%/mm": 10.0,
    "%/deg": 1.8 / math.pi,
    "1/m": 1.0,
    "1/turn": 0.5 / math.pi,
    "1/%": 100.0,
    "1/N": 1.0,
    "mm/s": 1e-3,
    "m/s": 1.0,
    "deg/s": math.pi / 180.0,
    "rad/s": 1.0,
    "ohm": 1.0,
    "N m/A": 1.0,
    "N m/rad": 1.0,
    "kPa/s": 1e3,
    "N/kPa": 1e-3,
    "N/bar": 1e-5,
    "N/bar/%": 1e-3,
    "N/%": 100.0,
    "N/bar^2": 1e-10,
    "N/bar^2/%": 1e-8,
    "N/mm": 1e3,
    "N/mm/kPa": 1.0,
    "N/mm^2": 1e6,
    "N/mm^3": 1e9,
    "N s/mm": 1e3,
    "N s/mm/kPa": 1.0,
    "N s^2/mm^2": 1e6,
    "N/V": 1.0,
    "kPa/V": 1e3,
    "m/V": 1.0,
    "m/V^2": 1.0,
    "V/mm": 1e3,
    "V/N": 1.0,
    "V/bar": 1e-5,
    "V/deg": 180.0 / math.pi,
    "N m s": 1.0,
    "N m s^2": 1.0,
    "N m/rad^3": 1.0,
    "kg m^2": 1.0,
}
"""Value in SI of one of each unit."""


@cache
def suffix(unit: str) -> str:
    """Return the ending of a name for a unit: `N/mm` gives `n_per_mm`, `1` nothing.

    >>> suffix("N s/mm"), suffix("kg m^2"), suffix("%"), suffix("1/kPa"), suffix("1")
    ('n_s_per_mm', 'kg_m2', 'percent', 'per_kpa', '')
    """
    if unit == "1":
        return ""
    name = unit.replace("1/", "per_", 1) if unit.startswith("1/") else unit
    name = name.replace("/", "_per_").replace(" ", "_").replace("^", "").replace("%", "percent")
    return name.lower()


def with_unit(number: str, unit: str) -> str:
    """Format a number with its unit; a pure number has none.

    >>> with_unit("0.5", "N/mm"), with_unit("0.5", "1")
    ('0.5 N/mm', '0.5')
    """
    return number if unit == "1" else f"{number} {unit}"


TURN_DEG = 360.0
"""A whole turn (deg)."""


@dataclass(frozen=True)
class Quantity:
    """Unit, bounds, neutral value, usual value and source of one physical parameter.

    Attributes:
        unit: unit in files (a key of `SI_FACTORS`); bounds, neutral and usual value are in it.
        lower: smallest value that makes physical sense.
        upper: largest value that makes physical sense.
        source: where the bounds and the usual value come from; says "assumption" for one.
        neutral: value at which the parameter has no effect at all, or None.
        instead: what to do for a value beyond the bounds; empty if the bounds are all.
        usual: value of a typical specimen, where a fit starts, or None.
    """

    unit: str
    lower: float
    upper: float
    source: str
    neutral: float | None = None
    instead: str = ""
    usual: float | None = None

    def __post_init__(self) -> None:
        """Refuse a unit without a factor, reversed bounds, and a usual value beyond them."""
        if self.unit not in SI_FACTORS:
            raise ValueError(
                f"unknown unit {self.unit!r}; write one of {', '.join(SI_FACTORS)}, or say before "
                f"it what one is in SI: pma_gym.units.SI_FACTORS[{self.unit!r}] = ..."
            )
        if not self.lower <= self.upper:
            bounds = with_unit(f"{self.lower} to {self.upper}", self.unit)
            raise ValueError(f"bounds {bounds} are reversed")
        if self.usual is not None:
            self.check("usual", self.usual)

    @property
    def turns(self) -> bool:
        """Whether it is an angle that a whole turn does not change: bounds of a turn either way."""
        return self.unit == "deg" and (self.lower, self.upper) == (-TURN_DEG, TURN_DEG)

    @property
    def factor(self) -> float:
        """SI value of one file unit."""
        return SI_FACTORS[self.unit]

    def name(self, stem: str) -> str:
        """Return the name in files of the parameter `stem`.

        >>> Quantity("N/kPa", 0, 10, "example").name("slope")
        'slope_n_per_kpa'
        """
        ending = suffix(self.unit)
        return f"{stem}_{ending}" if ending else stem

    def to_si(self, value: float) -> float:
        """Convert a value from the file unit to SI."""
        return value * self.factor

    def from_si(self, value: float) -> float:
        """Convert a value from SI to the file unit; a bound comes back as itself."""
        for end in (self.lower, self.upper):
            if value == self.to_si(end):
                return float(end)
        return value / self.factor

    def check(self, name: str, value: float) -> None:
        """Refuse a value (in file units) outside the bounds.

        Raises:
            ValueError: names the parameter, the range, the unit, what came and the mend.
        """
        if not self.lower <= value <= self.upper:
            raise ValueError(
                f"{name} must lie in {with_unit(f'{self.lower:g} to {self.upper:g}', self.unit)}, "
                f"got {value!r}; "
                f"{self.instead or 'check unit and decimal point'} (usual: {self.source})"
            )


_DECIMAL = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_LONGEST = 400
"""Characters of the longest number: the shortest text of any double has 24."""


def parse_number(text: str) -> float | None:
    """Parse the number in a text; None if there is none.

    A sign, ASCII digits with a decimal point, an exponent; blanks around it do not count. Neither
    `nan`, `inf`, `1_000`, digits of other scripts nor a number beyond the doubles (1e400) is one.

    Example:
        >>> parse_number(" -1.5e3 "), parse_number("1_000"), parse_number("nan")
        (-1500.0, None, None)
    """
    bare = text.strip(" \t\r\n")
    if len(bare) > _LONGEST or not _DECIMAL.fullmatch(bare):
        return None
    number = float(bare)
    return number if math.isfinite(number) else None


def parse_numbers(text: str) -> list[float] | None:
    """Parse numbers separated by commas; None if one of them is not a number.

    Example:
        >>> parse_numbers("150, 300,"), parse_numbers("150,nan"), parse_numbers("")
        ([150.0, 300.0], None, [])
    """
    numbers = [parse_number(part) for part in text.split(",") if part.strip()]
    known = [number for number in numbers if number is not None]
    return known if len(known) == len(numbers) else None
