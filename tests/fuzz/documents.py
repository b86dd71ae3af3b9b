"""Valid documents of every reader, and how a fuzzer changes them: values, keys, bytes."""

import copy
import json
from pathlib import Path

from hypothesis import strategies as st

ROOT = Path(__file__).parents[2]
HUGE = 10**400

ODD_VALUES = [
    0,
    3,
    -1,
    1.5,
    1e308,
    float("inf"),
    float("nan"),
    HUGE,
    "",
    " ",
    "text",
    "\x1b[31mred",
    "\ud800",
    "‮",
    "{{body}}",
    "=1+1",
    [],
    [[]],
    [1, "a"],
    {},
    {"a": 1},
    {"value": []},
    True,
    False,
    None,
    "1_000",
    "٣",
    "x" * 3000,
]
"""What stands for a value of the wrong kind."""


def places(document, front=()):
    """Ways to every value of a document."""
    if front:
        yield front
    pairs = (
        document.items()
        if isinstance(document, dict)
        else enumerate(document)
        if isinstance(document, list)
        else ()
    )
    for key, value in list(pairs):
        yield from places(value, (*front, key))


def put(document, place, value):
    """A copy of a document with another value at a place."""
    changed = copy.deepcopy(document)
    inside = changed
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = value
    return changed


def without(document, place):
    """A copy of a document without the value at a place."""
    changed = copy.deepcopy(document)
    inside = changed
    for key in place[:-1]:
        inside = inside[key]
    del inside[place[-1]]
    return changed


def toml(value):
    """A value as TOML; None as a text, for TOML has none."""
    if isinstance(value, bool):
        return str(value).lower()
    if value is None:
        return '"null"'
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(str(k))} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, str):
        # TOML refuses lone surrogates itself.
        return json.dumps(value.encode("utf-8", "replace").decode())
    return repr(value)


def toml_document(document):
    """A document as TOML, every table inline."""
    return "".join(f"{toml(str(key))} = {toml(value)}\n" for key, value in document.items())


@st.composite
def changed(draw, documents):
    """One of some documents with up to three values changed, removed, or doubled."""
    document = draw(st.sampled_from(documents))
    for _ in range(draw(st.integers(0, 3))):
        every = list(places(document))
        if not every:
            break
        place = draw(st.sampled_from(every))
        how = draw(st.sampled_from(["odd", "odd", "number", "text", "remove"]))
        if how == "remove":
            document = without(document, place)
            continue
        value = draw(
            {
                "odd": st.sampled_from(ODD_VALUES),
                "number": st.one_of(st.integers(), st.floats()),
                "text": st.text(max_size=20),
            }[how]
        )
        document = put(document, place, value)
    return document


@st.composite
def damaged(draw, contents):
    """One of some texts with bytes cut off, changed, doubled or glued."""
    content = bytearray(draw(st.sampled_from(contents)))
    for _ in range(draw(st.integers(0, 4))):
        start = draw(st.integers(0, len(content)))
        end = min(len(content), start + draw(st.integers(0, 40)))
        how = draw(st.sampled_from(["cut", "remove", "replace", "double", "insert"]))
        if how == "cut":
            del content[start:]
        elif how == "remove":
            del content[start:end]
        elif how == "double":
            content[start:start] = content[start:end] * draw(st.integers(1, 50))
        else:
            new = draw(st.one_of(st.binary(max_size=12), st.sampled_from(TOKENS)))
            content[start : end if how == "replace" else start] = new
    return bytes(content)


TOKENS = [
    b"[" * 60,
    b"{" * 60,
    b"a." * 60,
    b"9" * 500,
    b'"""',
    b"'''",
    b"\\u0000",
    b"\\ud800",
    b"1e400",
    b"NaN",
    b"&a [*a]",
    b"<<: *a",
    b"!!python/object/apply:os.system [x]",
    b"!!timestamp 1",
    b"!!int x",
    b"? [a]\n: b\n",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\r",
    b"\x00",
    b"1979-05-27T07:32:00Z",
    b"0x" + b"f" * 500,
    b"1:2:3:4",
]
