"""Lines of a text, within the limits before there are any."""

import io
from collections.abc import Sequence

from pma_gym.limits import check_limit, limit

_QUOTED = 20
"""Times the most columns that a line with quotes may have separators: some stand in cells."""


def split_lines(text: str, file: str) -> list[str]:
    """Lines of a text, each with its end.

    Raises:
        LimitError: more than the rows that are read.
    """
    check_limit(file, "rows", max(text.count("\n"), text.count("\r")))
    return list(io.StringIO(text, newline=""))


def check_widths(lines: Sequence[str], separator: str, file: str) -> None:
    """Refuse lines with more cells than are read, before they are taken apart.

    Raises:
        LimitError: names the file and the limit.
    """
    most = limit("columns")
    for line in lines:
        count = 1 + line.count(separator)
        if count > most * (_QUOTED if '"' in line or separator == " " else 1):
            check_limit(file, "columns", count)
