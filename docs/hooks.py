"""MkDocs hook: fills the pages' `<!-- generate: NAME -->` marks from the code."""

from typing import Any

# MkDocs puts this file's folder on the path while it loads it.
from generators import expand


def on_page_markdown(markdown: str, **rest: Any) -> str:  # noqa: ANN401 - MkDocs' own objects
    """The page with its marks filled."""
    return expand(markdown)
