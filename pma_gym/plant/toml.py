"""TOML of model files: text to a document and values to text, and what is said of a broken file."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from pma_gym.effects.effect import Value

_SHOWN = 60
"""Characters of a broken line that a message shows."""


class TOMLError(ValueError):
    """A file that is no TOML; the message says where, why and the mend."""


def read_toml(path: Path) -> dict[str, Any]:
    """The document in a TOML file.

    Raises:
        TOMLError: no UTF-8 text or no TOML; names the file, the line and the mend.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise TOMLError(
            f"{path} is not valid TOML: not UTF-8 text (byte {error.start}); save it as UTF-8"
        ) from error
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TOMLError(f"{path} is not valid TOML: {_broken(text, str(error))}") from error


def _broken(text: str, words: str) -> str:
    """Which line of a text is broken, what the reader says of it, and how a line should be.

    Args:
        text: of the file.
        words: the reader's own, which end in `(at line 5, column 7)` or `(at end of document)`.
    """
    found = re.search(r"at line (\d+)", words)
    lines = text.splitlines() or [""]
    number = int(found[1]) if found else len(lines)
    line = lines[min(number, len(lines)) - 1].strip()
    shown = line if len(line) <= _SHOWN else line[:_SHOWN] + "..."
    return (
        f"line {number}, {shown!r}: {words}; a line is a table, [effect], or name = value, the "
        'value a number 1.5, a text "in quotes" or { value = 1.5, source = "where from" }'
    )


def toml_text(value: str | Value) -> str:
    """A value as TOML has it.

    >>> toml_text("50 %"), toml_text((1.0, 0.1 + 0.2))
    ('"50 %"', '[1, 0.3]')
    """
    if isinstance(value, str):
        # The escapes of JSON are those of TOML.
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, tuple):
        return "[" + ", ".join(toml_text(one) for one in value) + "]"
    # Nine digits: below every interval, and free of the last bits that unit factors leave.
    return f"{value:.9g}"
