"""Documents from strangers: limits before memory is taken, one message, nothing executed.

Limits of the readers: settable, and said in one message.
"""

import os
import subprocess
import sys
import time

import pytest

from pma_gym.documents import (
    DocumentError,
    parse_json,
    parse_toml,
    parse_yaml,
    read_content,
    read_json,
    read_toml,
)
from pma_gym.limits import LIMITS, LimitError, check_limit, limit
from pma_gym.units import parse_number

DEEP = 100_000
LEVELS = [b"a: &a [x,x,x,x,x,x,x,x,x,x]"] + [
    f"{name}: &{name} [{','.join([f'*{before}'] * 10)}]".encode()
    for before, name in zip("abcdefgh", "bcdefghi", strict=True)
]

HOSTILE = {
    "dotted key": (parse_toml, b"a." * 60_000 + b"a = 1", "levels of nesting"),
    "dotted header": (parse_toml, b"[" + b"a." * 60_000 + b"a]", "levels of nesting"),
    "dotted quoted key": (parse_toml, b'"a" . ' * 60_000 + b"a = 1", "levels of nesting"),
    "dotted inline key": (parse_toml, b"x = {" + b"a." * 60_000 + b"a = 1}", "levels of nesting"),
    "many dotted keys": (
        parse_toml,
        b"\n".join(b"k%d" % i + b".a" * 40 + b" = 1" for i in range(8000)),
        "names or values",
    ),
    "many tables": (
        parse_toml,
        b"".join(b"[t%d.a.a.a]\n" % i for i in range(60_000)),
        "names or values",
    ),
    "deep array": (parse_toml, b"a = " + b"[" * DEEP + b"]" * DEEP, "line 1 of .* nesting"),
    "deep table": (parse_toml, b"\na = " + b"{a=" * DEEP, "line 2 of .* nesting"),
    "many digits": (parse_toml, b"x = {y = 1" + b"0" * 400 + b"}", "number in line 1 .* digits"),
    "hexadecimal": (parse_toml, b"x = 0x" + b"f" * 5000, "digits"),
    "large TOML": (parse_toml, b"#" * (2 << 20), "KiB a TOML document"),
    "deep JSON": (parse_json, b"[" * DEEP, "nesting"),
    "deep JSON object": (parse_json, b'{"a":' * DEEP, "nesting"),
    "digits of JSON": (parse_json, b"[" + b"9" * 401 + b"]", "digits"),
    "aliases": (parse_yaml, b"\n".join(LEVELS), "names or values"),
    "merged aliases": (
        parse_yaml,
        b"a0: &a0 {x: 1}\n"
        + b"\n".join(
            b"a%d: &a%d {%s}" % (i, i, b", ".join(b"k%d: *a%d" % (k, i - 1) for k in range(9)))
            for i in range(1, 9)
        ),
        "names or values",
    ),
    "deep YAML": (parse_yaml, b"[" * DEEP, "nesting"),
    "deep blocks": (parse_yaml, b"- " * DEEP, "nesting"),
    "deep by aliases": (
        parse_yaml,
        b"\n".join(
            b"a%d: &a%d %s*a%d%s" % (i, i, b"[" * 20, i - 1, b"]" * 20) if i else b"a0: &a0 x"
            for i in range(6)
        ),
        "nesting",
    ),
    "digits of YAML": (parse_yaml, b"a: " + b"9" * 401, "digits"),
    "base 60": (parse_yaml, b"a: 1" + b":1" * 100_000, "digits"),
    "large YAML": (parse_yaml, b"#" * (300 << 10), "KiB a YAML document"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_what_would_become_gigabytes_or_minutes_is_refused_by_a_limit(case):
    parse, content, message = HOSTILE[case]
    began = time.process_time()
    with pytest.raises(LimitError, match=f"(?s){message}") as caught:
        parse(content, "evil.txt")
    assert time.process_time() - began < 5.0
    assert "evil.txt" in str(caught.value) and "set the environment variable" in str(caught.value)
    assert len(str(caught.value)) < 300


def test_a_limit_takes_no_memory_first():
    """What is refused above takes no more than some copies of the text."""
    code = (
        "import resource\n"
        "from tests.test_documents import HOSTILE\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "for parse, content, _ in HOSTILE.values():\n"
        "    try:\n        parse(content, 'x')\n"
        "    except ValueError:\n        pass\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 200_000  # KiB


@pytest.mark.parametrize(
    ("parse", "content"),
    [(parse_toml, b"a = " + b"[" * 5000 + b"]" * 5000), (parse_json, b"[" * 50_000)],
)
def test_a_raised_limit_ends_in_no_traceback(parse, content, monkeypatch):
    monkeypatch.setenv("PMA_GYM_MAX_NESTING", "1000000")
    with pytest.raises(DocumentError, match="more deeply than Python can read; unset PMA_GYM_MAX"):
        parse(content, "evil.txt")


def test_a_limit_is_raised_by_what_its_message_says(monkeypatch):
    content = b"a = " + b"[" * 60 + b"]" * 60
    with pytest.raises(LimitError, match="PMA_GYM_MAX_NESTING to a larger number"):
        parse_toml(content, "deep.toml")
    monkeypatch.setenv("PMA_GYM_MAX_NESTING", "60")
    assert parse_toml(content, "deep.toml")


BROKEN = {
    "no UTF-8": (parse_toml, b"a = '\xff'", "not UTF-8 text .byte 5.; save it as UTF-8"),
    "no TOML": (parse_toml, b"a = 1\nb == 2\n", "line 2, 'b == 2'"),
    "infinite": (parse_toml, b"[a]\nb = inf\n", "a.b must be a finite number, .* got inf"),
    "beyond doubles": (parse_toml, b"a = 1e400", "a must be a finite number"),
    "whole beyond doubles": (parse_toml, b"a = 1" + b"0" * 390, "a must be a finite number"),
    "no JSON": (parse_json, b"{", "is not valid JSON"),
    "NaN": (parse_json, b'{"a": NaN}', "it has NaN, which is no number of JSON"),
    "UTF-16": (parse_json, "{}".encode("utf-16"), "not UTF-8 text"),
    "no YAML": (parse_yaml, b"a: [", "is not valid YAML"),
    "tag": (parse_yaml, b"!!python/object/apply:os.system [ls]", "is not valid YAML"),
    "date": (parse_yaml, b"!!timestamp x", "is not valid YAML"),
    "flag": (parse_yaml, b"!!bool x", "is not valid YAML"),
    "key": (parse_yaml, b"? [a]\n: b", "is not valid YAML"),
    "cycle": (parse_yaml, b"a: &a [*a]", "an alias inside what it names; write it out"),
    "YAML infinite": (parse_yaml, b"a: .inf", "a must be a finite number"),
    "two documents": (parse_yaml, b"a: 1\n---\nb: 1\n", "is not valid YAML"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_document_is_one_message(case):
    parse, content, message = BROKEN[case]
    with pytest.raises(DocumentError, match=message) as caught:
        parse(content, "evil.txt")
    assert str(caught.value).startswith("evil.txt") and "\n" not in str(caught.value)


def test_sound_documents_read_as_before():
    toml = b'\xef\xbb\xbftitle = """a\n[[[[ {{{{ 1.2.3"""\r\n# [[[\n[a.b]\nc = [1, 2.5, "x"]\n'
    assert parse_toml(toml, "x") == {
        "title": "a\n[[[[ {{{{ 1.2.3",
        "a": {"b": {"c": [1, 2.5, "x"]}},
    }
    assert parse_json(b'{"a": "[[[[\\"[[[", "b": [1, -2.5e3, null]}', "x") == {
        "a": '[[[["[[[',
        "b": [1, -2500.0, None],
    }
    # The zoo's files share settings by aliases.
    assert parse_yaml(b"a: &a {x: 1}\nb: {<<: *a, y: 2}\n", "x")["b"] == {"x": 1, "y": 2}
    assert parse_yaml(b"", "x") is None


def test_control_codes_become_escapes_but_not_in_our_own_journals():
    assert parse_toml(rb'a = "\u001b[31mred\u202e"', "x") == {"a": r"\x1b[31mred" + r"\u202e"}
    assert parse_json(b'{"a": "\\u001b"}', "x") == {"a": r"\x1b"}
    assert parse_json(b'{"a": "\\udcff"}', "x", own=True) == {"a": "\udcff"}


def test_only_ordinary_files_are_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, message in (
        (tmp_path / "pipe", "no ordinary file"),
        (tmp_path, "no ordinary file|cannot be read"),
        (tmp_path / "none", "cannot be read: No such file"),
    ):
        with pytest.raises(DocumentError, match=message):
            read_content(path)


def test_a_sparse_file_of_a_terabyte_is_refused_by_its_size(tmp_path):
    path = tmp_path / "large.json"
    with path.open("wb") as file:
        file.truncate(1 << 36)
    for read in (read_json, read_toml):
        with pytest.raises(LimitError, match="KiB"):
            read(path)


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_is_kept_and_the_message_says_how_to_raise_it(name, monkeypatch):
    check_limit("log.csv", name, LIMITS[name].usual)
    with pytest.raises(LimitError, match=f"log.csv .* PMA_GYM_MAX_{name.upper()} "):
        check_limit("log.csv", name, LIMITS[name].usual + 1)
    monkeypatch.setenv(f"PMA_GYM_MAX_{name.upper()}", str(LIMITS[name].usual + 1))
    check_limit("log.csv", name, LIMITS[name].usual + 1)


@pytest.mark.parametrize("text", ["", "0", "-1", "1e9", "1_000", "٣", "9" * 30])
def test_a_limit_that_is_no_positive_whole_number_is_refused(text, monkeypatch):
    monkeypatch.setenv("PMA_GYM_MAX_ROWS", text)
    with pytest.raises(LimitError, match="PMA_GYM_MAX_ROWS must be a positive whole number"):
        limit("rows")


@pytest.mark.parametrize(
    "text", ["", " ", "nan", "inf", "1_000", "1,5", "٣", "１", "0x10", "1e400", "1e", ".", "1 2"]
)
def test_what_is_no_decimal_number_is_none(text):
    assert parse_number(text) is None


@pytest.mark.parametrize("text", ["1", "-1.5", "+.5", "5.", "1e-3", " 2\r\n", "1E+05"])
def test_a_decimal_number_is_pythons(text):
    assert parse_number(text) == float(text)
