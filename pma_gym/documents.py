"""Readers of TOML, JSON and YAML files: limits before memory is taken, one kind of error.

A parser of the standard library answers a file of a few kilobytes with gigabytes, minutes or a
RecursionError. Each text is scanned before it is parsed: size, nesting, names and digits.

Text that is safe to show: control codes in names and file names never reach a terminal.

Names, titles, columns and paths come from files of strangers. An escape code in one could move the
cursor, change colours or hide text; a bidi control could reorder a line.
"""

import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pma_gym.limits import PREFIX, LimitError, check_limit, limit

_UNSAFE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)
"""Control codes but tab and line feed, bidi controls, bytes of names that are no UTF-8."""


def printable(text: str) -> str:
    r"""Replace control codes and invalid characters of a text by escapes.

    Example:
        >>> printable("a\x1b[31mb"), printable("\udce9t\u00e9")
        ('a\\x1b[31mb', '\\udce9t\xe9')
    """
    return _UNSAFE.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


_SHOWN = 60
"""Characters of a broken line or a key that a message shows."""

_LARGEST_BITS = 1023
"""Bits of the largest whole number that a double holds for certain."""

_JSON_TEXT = re.compile(r'"[^"\\]*+(?:\\.[^"\\]*+)*+"', re.DOTALL)
_TOML_TEXT = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*+"{3,5}'
    r"|'''(?:[^']|'(?!''))*+'{3,5}"
    r'|"[^"\\\n]*+(?:\\.[^"\\\n]*+)*+"'
    r"|'[^'\n]*+'"
    r"|#[^\n]*+",
    re.DOTALL,
)
_TOML_KEY = re.compile(r"[^\n=,\[\]{}]*+[=\]]")
_LONG_NUMBER = r"(?<![0-9A-Za-z_])[+-]?[0-9][0-9A-Za-z_]{%d,}"


class DocumentError(ValueError):
    """A document that cannot be used; the message names file, rule, what came and the fix."""


def is_file(path: Path) -> bool:
    """Return whether a file exists; False for a name that the system refuses (too long)."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_content(path: Path, name: str = "document_kib") -> bytes:
    """Read the bytes of an ordinary file within a limit.

    Args:
        path: the file.
        name: of the limit on its size, `document_kib` or another in KiB or MiB.
    Raises:
        DocumentError: there is no such file, or it cannot be read.
        LimitError: it is larger than the limit.
    """
    unit = 1 << (20 if name.endswith("_mib") else 10)
    try:
        # Without O_NONBLOCK opening a named pipe waits for a writer.
        with open(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise DocumentError(f"{path} is no ordinary file; name a file on a disk")
            check_limit(str(path), name, status.st_size / unit)
            content = file.read(limit(name) * unit + 1)
    except OSError as error:
        why = error.strerror or type(error).__name__
        raise DocumentError(
            f"{path} cannot be read: {why}; check the name and the rights"
        ) from error
    check_limit(str(path), name, len(content) / unit)
    return content


def read_toml(path: Path, form: str = "", finite: bool = True) -> dict[str, Any]:
    """Read the document in a TOML file.

    Args:
        path: the file.
        form: how a line should be, the end of the message on a broken one.
        finite: whether TOML's `nan` and `inf` are refused; whoever names units does so himself.
    Raises:
        DocumentError: no UTF-8 text, no TOML, or a number beyond the doubles.
        LimitError: beyond a limit of `pma_gym.limits`.
    """
    return parse_toml(read_content(path), str(path), form, finite)


def parse_toml(content: bytes, file: str, form: str = "", finite: bool = True) -> dict[str, Any]:
    """Parse TOML as `read_toml` does, from the file's content; messages use its name."""
    check_limit(file, "toml_kib", len(content) / 1024)
    # tomllib does so too: positions count with line feeds alone.
    text = _decoded(content, file, "TOML").replace("\r\n", "\n")
    bare = _TOML_TEXT.sub(_blank, text)
    _check_scan(file, bare)
    parts = 0
    for key in _TOML_KEY.finditer(bare):
        dots = key[0].count(".")
        check_limit(file, "nesting", dots)
        parts += 1 + dots
    check_limit(file, "values", parts)
    with _within_the_stack(file):
        try:
            document = tomllib.loads(text)
        except ValueError as error:
            raise DocumentError(
                f"{file} is not valid TOML: {_broken(text, str(error))}{form and '; '}{form}"
            ) from error
        return _checked(document, file, finite=finite)


def read_json(
    path: Path, name: str = "document_kib", own: bool = False, finite: bool = True
) -> Any:  # noqa: ANN401
    """Read the value in a JSON file.

    Args:
        path: the file.
        name: of the limit on its size.
        own: whether this project wrote it: texts stay as they are, file names in them included.
        finite: whether NaN and Infinity, which Python writes, are refused.
    Raises:
        DocumentError: no UTF-8 text, no JSON, NaN, or a number beyond the doubles.
        LimitError: beyond a limit of `pma_gym.limits`.
    """
    return parse_json(read_content(path, name), str(path), own, finite)


def parse_json(content: bytes, file: str, own: bool = False, finite: bool = True) -> Any:  # noqa: ANN401
    """Parse JSON as `read_json` does, from the file's content; messages use its name."""
    text = _decoded(content, file, "JSON")
    _check_scan(file, _JSON_TEXT.sub(_blank, text))

    def constant(word: str) -> float:
        if finite:
            raise ValueError(f"it has {word}, which is no number of JSON")
        return float(word)

    with _within_the_stack(file):
        try:
            value = json.loads(text, parse_constant=constant)
        except ValueError as error:
            raise DocumentError(f"{file} is not valid JSON: {error}; write it anew") from error
        return _checked(value, file, own, finite)


def read_yaml(path: Path, finite: bool = True) -> Any:  # noqa: ANN401
    """Read the value in a YAML file of one document; tags and aliases make only data.

    Args:
        path: the file.
        finite: whether `.nan` and `.inf` are refused; whoever names settings does so himself.
    Raises:
        DocumentError: no UTF-8 text, no YAML, or a number beyond the doubles.
        LimitError: beyond a limit of `pma_gym.limits`, aliases counted as often as they stand.
        ImportError: PyYAML is not installed.
    """
    return parse_yaml(read_content(path), str(path), finite)


def parse_yaml(content: bytes, file: str, finite: bool = True) -> Any:  # noqa: ANN401
    """Parse YAML as `read_yaml` does, from the file's content; messages use its name."""
    check_limit(file, "yaml_kib", len(content) / 1024)
    text = _decoded(content, file, "YAML")
    with _within_the_stack(file):
        try:
            value = _constructed(text, file)
        except (DocumentError, LimitError, ImportError, RecursionError):
            raise
        # PyYAML's constructors of dates and flags raise AttributeError, KeyError and others.
        except Exception as error:
            raise DocumentError(f"{file} is not valid YAML: {_line(str(error))}") from error
        return _checked(value, file, finite=finite)


def _constructed(text: str, file: str) -> Any:  # noqa: ANN401
    """The value of a YAML text; limits are checked on its events and its nodes before."""
    import yaml

    kind = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    depth = 0
    for event in yaml.parse(text, kind):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        check_limit(file, "nesting", depth)
    loader = kind(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _check_nodes(file, node)
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _check_nodes(file: str, root: Any) -> None:  # noqa: ANN401 - a node of PyYAML
    """Count values and nesting with every alias written out, and digits."""
    known: dict[int, tuple[int, int] | None] = {}
    digits = limit("digits")

    def measure(node: Any) -> tuple[int, int]:  # noqa: ANN401
        if id(node) in known:
            measured = known[id(node)]
            if measured is None:
                raise DocumentError(f"{file} has an alias inside what it names; write it out")
            return measured
        known[id(node)] = None
        size, depth = 1, 0
        if isinstance(node.value, str):
            if len(node.value) > digits and not node.tag.endswith((":str", ":binary")):
                check_limit(file, "digits", len(node.value))
        else:
            for entry in node.value:
                for part in entry if isinstance(entry, tuple) else (entry,):
                    more, below = measure(part)
                    size, depth = size + more, max(depth, 1 + below)
        check_limit(file, "values", size)
        check_limit(file, "nesting", depth)
        known[id(node)] = (size, depth)
        return size, depth

    measure(root)


def _decoded(content: bytes, file: str, kind: str) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DocumentError(
            f"{file} is not valid {kind}: not UTF-8 text (byte {error.start}); save it as UTF-8"
        ) from error


def _blank(quoted: re.Match[str]) -> str:
    """What stands for a text in quotes or a comment: no brackets, as many lines."""
    return '""' + "\n" * quoted[0].count("\n")


@contextmanager
def _within_the_stack(file: str) -> Iterator[None]:
    try:
        yield
    except RecursionError:
        raise DocumentError(
            f"{file} is nested more deeply than Python can read; unset {PREFIX}NESTING"
        ) from None


def _check_scan(file: str, bare: str) -> None:
    """Limits on a text without what stands in quotes: nesting of brackets and digits of numbers."""
    codes = np.frombuffer(bare.encode("utf-32-le", "surrogatepass"), np.uint32)
    steps = np.isin(codes, [91, 123]).astype(np.int8) - np.isin(codes, [93, 125]).astype(np.int8)
    depth = np.cumsum(steps, dtype=np.int32)
    deepest = int(depth.argmax()) if depth.size else 0
    line = bare.count("\n", 0, deepest) + 1
    check_limit(f"line {line} of {file}", "nesting", int(depth.max(initial=0)))
    match = re.search(_LONG_NUMBER % limit("digits"), bare)
    if match:
        line = bare.count("\n", 0, match.start()) + 1
        check_limit(f"a number in line {line} of {file}", "digits", len(match[0]))


def _checked(document: Any, file: str, own: bool = False, finite: bool = True) -> Any:  # noqa: ANN401
    """A document whose numbers are finite and whose texts hold no control codes."""
    plain: Callable[[str], str] = str if own else printable

    def checked(value: Any, place: str) -> Any:  # noqa: ANN401
        if isinstance(value, dict):
            return {
                checked(key, place): checked(each, f"{place}.{key}" if place else f"{key}")
                for key, each in value.items()
            }
        if isinstance(value, list):
            return [checked(each, place) for each in value]
        if isinstance(value, str):
            return plain(value)
        if isinstance(value, int) and value.bit_length() > _LARGEST_BITS:
            raise _beyond(file, place, f"a whole number of {value.bit_length()} bits")
        if finite and isinstance(value, float) and not math.isfinite(value):
            raise _beyond(file, place, str(value))
        return value

    return checked(document, "")


def _beyond(file: str, place: str, value: str) -> DocumentError:
    shown = printable(place[:_SHOWN]) or "the value"
    return DocumentError(
        f"{file}: {shown} must be a finite number, below 1e308 in size, got {value}; correct it"
    )


def _broken(text: str, message: str) -> str:
    """Which line of a text is broken, and what the parser says of it.

    Args:
        text: of the file.
        message: the parser's, which end in `(at line 5, column 7)` or `(at end of document)`.
    """
    match = re.search(r"at line (\d+)", message)
    lines = text.splitlines() or [""]
    number = int(match[1]) if match else len(lines)
    line = lines[min(number, len(lines)) - 1].strip()
    shown = line if len(line) <= _SHOWN else line[:_SHOWN] + "..."
    return f"line {number}, {shown!r}: {_line(message)}"


def _line(message: str) -> str:
    """A parser's words on one line, of a length that a terminal shows."""
    message = printable(" ".join(message.split()))
    return message if len(message) <= 4 * _SHOWN else message[: 4 * _SHOWN] + "..."
