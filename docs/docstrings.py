"""Griffe extension: reads the docstrings as they are written here.

Sections follow each other without a blank line, and examples stand wherever they belong; Griffe
wants a blank line above a section, and shows examples as code in a section of their own only.
"""

import re
from typing import Any

import griffe

_SECTION = re.compile(r"(Args|Attributes|Returns|Raises|Warns|Source|Example):")


class Docstrings(griffe.Extension):
    """Prepares every docstring."""

    def on_instance(self, *, obj: griffe.Object, **rest: Any) -> None:  # noqa: ANN401
        """Space the sections and fence the examples of an object's docstring."""
        if obj.docstring:
            obj.docstring.value = fenced(spaced(obj.docstring.value))


def spaced(text: str) -> str:
    """A docstring with a blank line above every section."""
    lines: list[str] = []
    for line in text.split("\n"):
        if _SECTION.fullmatch(line) and lines and lines[-1]:
            lines.append("")
        lines.append(line)
    return "\n".join(lines)


def fenced(text: str) -> str:
    """A docstring with its examples between code fences.

    An example ends at a blank line, as doctest has it.
    """
    lines: list[str] = []
    indent: str | None = None
    for line in [*text.split("\n"), ""]:
        bare = line.lstrip()
        if indent is None and bare.startswith(">>>"):
            indent = line.removesuffix(bare)
            lines.append(f"{indent}```pycon")
        elif indent is not None and not bare:
            lines.append(f"{indent}```")
            indent = None
        lines.append(line)
    return "\n".join(lines[:-1])
