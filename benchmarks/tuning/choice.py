"""Choice of named tables on the command line."""

import difflib
import fnmatch
from collections.abc import Iterable


def chosen(names: Iterable[str], only: str) -> list[str]:
    """Names that patterns match, each once, in their own order.

    >>> chosen(["hard/displacement", "hard/rotation", "robust/rotation"], "*/rotation")
    ['hard/rotation', 'robust/rotation']

    Args:
        names: what there is.
        only: patterns as of file names, by commas.
    Raises:
        ValueError: a pattern matches nothing.
    """
    known = list(dict.fromkeys(names))
    wanted: set[str] = set()
    for pattern in (part.strip() for part in only.split(",")):
        matching = fnmatch.filter(known, pattern)
        if not matching:
            near = difflib.get_close_matches(pattern, known, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise ValueError(
                f"only must match a table, got {pattern!r}; tables: {', '.join(known)}{hint}"
            )
        wanted.update(matching)
    return [name for name in known if name in wanted]
