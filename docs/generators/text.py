"""Markdown from tables and docstrings."""

import inspect
import re
from collections.abc import Iterable, Sequence

_SECTION = re.compile(r"^(Args|Attributes|Returns|Raises|Source|Example):$", re.MULTILINE)


def table(
    header: Sequence[str], rows: Iterable[Sequence[object]], right: Sequence[int] = ()
) -> str:
    """A Markdown table.

    Args:
        header: names of the columns.
        rows: cells.
        right: columns of numbers, aligned right.
    """
    lines = [header, ["--:" if column in right else ":--" for column in range(len(header))], *rows]
    return "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines)


def code(name: object) -> str:
    """A name set as code."""
    return f"`{name}`"


def number(value: float) -> str:
    """A number without digits that say nothing: 0.0321, 1e-06, 250."""
    return f"{value:.6g}"


def sections(documented: object) -> dict[str, str]:
    """A docstring's text before its sections, under "", and each section by its name.

    Equations, which docstrings indent by four, come out as Markdown's code blocks.
    """
    parts = _SECTION.split(inspect.getdoc(documented) or "")
    named = zip(parts[1::2], parts[2::2], strict=True)
    return {"": parts[0].strip()} | {name: inspect.cleandoc(text) for name, text in named}


def summary(documented: object) -> str:
    """The first paragraph of a docstring on one line."""
    return " ".join(sections(documented)[""].split("\n\n")[0].split())


def entries(section: str) -> dict[str, str]:
    """The entries of an `Args:` or `Attributes:` section on one line each, by name."""
    matches = re.findall(r"^(\w+): (.*(?:\n    .*)*)", section, re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in matches}


def _cell(value: object) -> str:
    return str(value).replace("\n", " ").replace("|", "\\|")
