"""MkDocs hooks: fill the pages' `<!-- generate: NAME -->` marks from the code, name table cells."""

import html
import itertools
import re
from typing import Any

# MkDocs puts this file's folder on the path while it loads it.
from generators import expand


def on_page_markdown(markdown: str, **rest: Any) -> str:  # noqa: ANN401 - MkDocs' own objects
    """The page with its marks filled."""
    return expand(markdown)


def on_page_content(content: str, **rest: Any) -> str:  # noqa: ANN401 - MkDocs' own objects
    """The page with every cell naming its column, for phones, where a row is a list."""
    return re.sub(r"<table>.*?</table>", _with_names, content, flags=re.DOTALL)


def _with_names(table: re.Match[str]) -> str:
    head, mark, body = table[0].partition("</thead>")
    names = [re.sub(r"<[^>]*>", "", cell) for cell in re.findall(r"<th[ >].*?</th>", head)]
    # A name has its entities already.
    column = itertools.cycle(html.escape(html.unescape(name)) for name in names)
    return head + mark + re.sub(r"<td", lambda cell: f'<td data-name="{next(column)}"', body)
