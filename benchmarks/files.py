"""Results on disk: each file whole or not at all, in a folder made for it.

Damaged files of results: their contents are recomputed, with one warning.
"""

import csv
import io
import json
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pma_gym.documents import printable
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


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Rows, the header first, as a CSV file has them."""
    out = io.StringIO(newline="")
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def toml_document(comment: str, schema: int, tables: Mapping[str, Any]) -> str:
    """Write nested tables of numbers, texts and lists as TOML, one headed table a leaf.

    Args:
        comment: what the file is, its first line.
        schema: version of its form.
        tables: tables by their keys, sorted by the outermost.

    >>> print(toml_document("Gains", 1, {"my rig": {"pid": {"lead_s": [0.1, 2]}}}), end="")
    # Gains
    schema = 1
    <BLANKLINE>
    ["my rig".pid]
    lead_s = [0.1, 2]
    """

    def lines(name: str, table: Mapping[str, Any]) -> Iterator[str]:
        # Lists, texts and numbers are written in JSON as in TOML.
        values = [f"{k} = {json.dumps(v)}" for k, v in table.items() if not isinstance(v, Mapping)]
        if values:
            yield "\n".join(["", f"[{name}]", *values])
        for key, inner in table.items():
            if isinstance(inner, Mapping):
                yield from lines(f"{name}.{_key(key)}", inner)

    parts = [line for name in sorted(tables) for line in lines(_key(name), tables[name])]
    return "\n".join([f"# {comment}", f"schema = {schema}", *parts]) + "\n"


def _key(name: str) -> str:
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else json.dumps(name)


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
