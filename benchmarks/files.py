"""Results on disk: each file whole or not at all, in a folder made for it."""

from pathlib import Path

from pma_gym.files import replace_file

RESULTS = Path("results")
"""Folder of a folder of results for each suite, where none is given."""


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file; an older one stays until the new one is complete.

    Args:
        path: the file; its folder is made.
        content: all of it.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, content)


def write_text(path: Path, text: str) -> None:
    """As `write_bytes`, for text in UTF-8; bytes of file names that are none become escapes."""
    write_bytes(path, text.encode("utf-8", "backslashreplace"))
