"""Rename the packages `controllers` and `benchmarks` in source text, for a wheel of their own.

Top-level names as common as these would overwrite other people's packages. What is renamed:
imports, strings that name a module or a path inside the packages, and `python -m benchmarks` in
messages.
"""

import io
import re
import tokenize

NAMES = {"controllers": "pma_gym_controllers", "benchmarks": "pma_gym_benchmarks"}
"""Names in a clone, and in the wheel."""

_OLD = "|".join(NAMES)
_IMPORT = re.compile(rf"^(\s*(?:from|import)\s+)({_OLD})(?=[\s.,])", re.MULTILINE)
_ALIASED = re.compile(rf"^(\s*import\s+)({_OLD})(\s+as\s)", re.MULTILINE)
_BARE = re.compile(rf"^\s*import\s+({_OLD})(?:\.[\w.]+)?\s*$", re.MULTILINE)
_PATH = re.compile(rf"(?<![\w./-])({_OLD})(?=(?:\.[a-z_]\w*|/[\w*]|:[A-Z]))")
_PROGRAM = re.compile(r"(python -m )(benchmarks)\b")


def renamed_source(text: str) -> str:
    """Python source in which the packages have their names of the wheel.

    >>> print(renamed_source("from controllers.pid import PID"))
    from pma_gym_controllers.pid import PID
    >>> print(renamed_source('name = "controllers.pid:PID"'))
    name = "pma_gym_controllers.pid:PID"
    >>> print(renamed_source('controllers = {"controllers": 1}'))
    controllers = {"controllers": 1}
    """
    used = {match[1] for match in _BARE.finditer(text)}
    text = "".join(_renamed_tokens(text, used))
    return _IMPORT.sub(lambda match: match[1] + NAMES[match[2]], text)


def renamed_strings(text: str) -> str:
    """Text, such as YAML, in which modules and paths have their names of the wheel."""
    text = _PROGRAM.sub(lambda match: match[1] + NAMES[match[2]], text)
    return _PATH.sub(lambda match: NAMES[match[1]], text)


def _renamed_tokens(text: str, used: set[str]) -> list[str]:
    """The text in pieces: strings renamed, and attributes of packages that are imported whole."""
    lines = text.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    pieces, at = [], 0
    tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    strings = {tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}
    for token, following in zip(tokens, tokens[1:], strict=False):
        begin = starts[token.start[0] - 1] + token.start[1]
        end = starts[token.end[0] - 1] + token.end[1]
        if token.type in strings and token.string.strip("\"'") in NAMES:
            # A name alone is a package only where a program is started: "-m", "benchmarks".
            name = token.string.strip("\"'")
            started = re.search(r"""["']-m["'],\s*$""", text[:begin])
            new = token.string.replace(name, NAMES[name]) if started else None
        elif token.type in strings:
            new = renamed_strings(text[begin:end])
        elif token.type == tokenize.NAME and token.string in used and following.string == ".":
            new = NAMES[token.string] if not text[:begin].rstrip(" ").endswith(".") else None
        else:
            new = None
        if new is not None:
            pieces += [text[at:begin], new]
            at = end
    return [*pieces, text[at:]]
