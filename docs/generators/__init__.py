"""Parts of the documentation that are rendered from the code, so that they cannot be out of date.

A page says `<!-- generate: NAME -->` or `<!-- generate: NAME ARGUMENT -->` on a line of its own;
`expand` puts in Markdown instead, as far indented. GENERATORS lists the names.
"""

import inspect
import re
from collections.abc import Callable
from textwrap import indent

from generators import (
    catalogue,
    commands,
    decisions,
    dissertation,
    environments,
    models,
    results,
)

GENERATORS: dict[str, Callable[..., str]] = {
    name: function
    for module in (catalogue, commands, decisions, dissertation, environments, models, results)
    for name, function in inspect.getmembers(module, inspect.isfunction)
    if function.__module__ == module.__name__ and not name.startswith("_")
}
"""Renderers by name; each takes the words after its name in the mark."""

_MARK = re.compile(r"^( *)<!-- generate: (.+?) -->$", re.MULTILINE)


def expand(markdown: str) -> str:
    """A page's Markdown with its marks filled.

    Raises:
        KeyError: a mark names no generator.
    """

    def fill(mark: re.Match[str]) -> str:
        name, *arguments = mark[2].split()
        if name not in GENERATORS:
            raise KeyError(f"no generator {name!r}; there are {', '.join(GENERATORS)}")
        return indent(GENERATORS[name](*arguments), mark[1])

    return _MARK.sub(fill, markdown)
