"""Consoles and streams that show control codes in text as escapes."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from pma_gym.documents import printable

WIDTH = 160
"""Columns of a table where no terminal limits them."""


class SafeConsole(Console):
    """A Rich console for plain text: no markup, no emoji codes, no control codes."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"markup": False, "emoji": False, **options})

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render as Rich does, with control codes in text escaped."""
        for segment in super().render(renderable, options):
            plain = segment.control is None
            yield segment._replace(text=printable(segment.text)) if plain else segment


def table_console() -> SafeConsole:
    """Create the console for tables; without a terminal, as wide as the tables."""
    console = SafeConsole()
    return console if console.is_terminal else SafeConsole(width=WIDTH)


class _SafeStream:
    """A text stream that writes printable text; what it cannot encode it writes as escapes."""

    def __init__(self, stream: TextIO) -> None:
        # Rich looks for this name and writes to that stream, which colours need.
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        self.rich_proxied_file.write(printable(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the stream has
        return getattr(self.rich_proxied_file, name)


@contextmanager
def safe_streams() -> Iterator[None]:
    """Escape control codes on standard output and error inside the context.

    Strict ASCII or cp1252 terminals get escapes for characters that they lack, not an error.
    """
    before = sys.stdout, sys.stderr
    for stream in before:
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    sys.stdout, sys.stderr = (
        stream if stream is None or isinstance(stream, _SafeStream) else _SafeStream(stream)
        for stream in before
    )  # type: ignore[assignment]
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
