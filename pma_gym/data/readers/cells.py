"""Cells to numbers: signs, decimal marks, grouped thousands, words for "not measured"."""

import math
import re
from collections.abc import Iterable

from pma_gym.data.readers.table import Cells
from pma_gym.units import parse_number

NOT_MEASURED = ("", "nan", "na")
"""Texts, in any case, of a cell in which nothing was measured; they can mean nothing else."""

_BLANKS = "'\u2019\u00a0\u2009\u202f "
"""Marks between groups of three digits that are neither point nor comma."""
_SPACED = re.compile(rf"[+-]?[0-9]{{1,3}}(?:[{_BLANKS}][0-9]{{3}})+(?:[.,][0-9]+)?")
_GROUPS = {
    mark: re.compile(rf"[+-]?[1-9][0-9]{{0,2}}(?:\{other}[0-9]{{3}})+(?:\{mark}[0-9]+)?")
    for mark, other in ((".", ","), (",", "."))
}
"""By decimal mark: a number whose thousands are grouped by the other mark."""
_DECIMAL = {
    mark: re.compile(rf"[+-]?(?:[0-9]+\{mark}[0-9]*|\{mark}[0-9]+)(?:[eE][+-]?[0-9]+)?")
    for mark in ".,"
}
_LONGEST = 100
"""Characters of the longest cell that is looked at for marks."""
_MINUS = str.maketrans(dict.fromkeys("\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d", "-"))
"""Signs that a locale or a word processor writes for a minus."""


def bare_text(cell: str) -> str:
    """The text of a cell without blanks around it, every minus as ASCII's."""
    bare = cell.strip()
    return bare if bare.isascii() else bare.translate(_MINUS)


def decimal_mark(columns: Iterable[Cells]) -> str:
    """The decimal mark of a file's numbers, by all of its cells.

    A comma is one where some cell can be read in no other way (`0,5`, `25,3`) and no cell needs a
    point; else it is the point.

    Args:
        columns: cells of the columns that hold numbers.
    Returns:
        "." or ",".
    """
    comma = False
    for cells in columns:
        for cell in cells:
            if not isinstance(cell, str) or len(cell) > _LONGEST:
                continue
            bare = bare_text(cell)
            if "." in bare and _DECIMAL["."].fullmatch(bare) and not _GROUPS[","].fullmatch(bare):
                return "."
            if "," in bare and "." in bare and _GROUPS["."].fullmatch(bare):
                return "."
            if "," in bare and not _GROUPS["."].fullmatch(bare):
                comma = comma or bool(_DECIMAL[","].fullmatch(bare) or _GROUPS[","].fullmatch(bare))
    return "," if comma else "."


def has_groups(cells: Cells, mark: str, stated: bool = False) -> bool:
    """Test whether a column's numbers have grouped thousands.

    Args:
        cells: of the column.
        mark: the file's decimal mark.
        stated: whether the lab states it: then the other mark can only group.
    Returns:
        True where one cell shows both marks, or two groups: `3,785.9` and `1,234,567` can be read
        in one way; `3,785` alone in two.
    """
    other = "," if mark == "." else "."
    for cell in cells:
        if isinstance(cell, str) and other in cell and len(cell) <= _LONGEST:
            bare = bare_text(cell)
            sure = stated or mark in bare or bare.count(other) > 1
            if sure and _GROUPS[mark].fullmatch(bare):
                return True
    return False


def cell_number(cell: object, mark: str = ".", grouped: bool = False) -> float | None:
    """The number in a cell.

    Args:
        cell: number, text or None.
        mark: decimal mark of the file.
        grouped: whether the column groups thousands by the other mark.
    Returns:
        The number; NaN where nothing was measured; None for anything else.

    Example:
        >>> cell_number("25,3", ","), cell_number("3,785.9", ".", True), cell_number("1_000")
        (25.3, 3785.9, None)
    """
    if not isinstance(cell, str):
        return _object_number(cell)
    bare = bare_text(cell)
    plain = parse_number(bare)
    if plain is not None and (mark == "." or "." not in cell):
        return plain
    if bare.lower() in NOT_MEASURED:
        return math.nan
    return None if len(bare) > _LONGEST else _marked(bare, mark, grouped)


def _marked(bare: str, mark: str, grouped: bool) -> float | None:
    """The number in a text with decimal commas or grouped thousands."""
    if _SPACED.fullmatch(bare):
        bare = re.sub(f"[{_BLANKS}]", "", bare)
    other = "," if mark == "." else "."
    if other in bare:
        both = mark in bare or bare.count(other) > 1
        if not (_GROUPS[mark].fullmatch(bare) and (grouped or both)):
            return None
        bare = bare.replace(other, "")
    return parse_number(bare.replace(",", "."))


def _object_number(cell: object) -> float | None:
    """The number in a cell that is no text."""
    if cell is None:
        return math.nan
    if isinstance(cell, bool) or not isinstance(cell, int | float):
        return None
    try:
        return float(cell)
    except OverflowError:
        return None


def looks_ambiguous(cell: object) -> bool:
    """Whether a cell's comma or point may be a decimal mark or group thousands: `3,785`."""
    bare = bare_text(cell) if isinstance(cell, str) and len(cell) <= _LONGEST else ""
    return any(groups.fullmatch(bare) is not None for groups in _GROUPS.values())
