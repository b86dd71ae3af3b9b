"""Decimal numbers in text: one strict grammar for every reader."""

import math
import re

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
