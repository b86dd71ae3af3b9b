"""Damaged files of results: their contents are recomputed, with one warning."""

import sys
from functools import cache
from pathlib import Path

from pma_gym.documents import printable

UNREADABLE = (
    OSError,
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    IndexError,
    ArithmeticError,
)
"""What reading a damaged file, or building something of its content, raises."""


def reason(error: BaseException) -> str:
    """An error in a few words."""
    message = " ".join(str(error).split())
    kind = type(error).__name__
    return message if isinstance(error, OSError | ValueError) else f"{kind}: {message}"


@cache
def say_damaged(path: Path, why: str, then: str = "what it held is computed anew") -> None:
    """Say once that a file is damaged.

    Args:
        path: the file or the folder.
        why: what is wrong with it.
        then: what happens now.
    """
    # A reader names the file itself, and says how a stranger's is put right.
    why = why.replace(f"{path}: ", "").replace(f"{path} ", "").removesuffix("; write it anew")
    print(f"warning: {path} is damaged ({printable(why)}); {then}", file=sys.stderr)
