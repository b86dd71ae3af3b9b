"""Any bytes become a value or the reader's own ValueError: no traceback, no hang, no gigabytes.

PMA_GYM_FUZZ_EXAMPLES sets how many inputs each reader gets; `make fuzz` gives many.

Valid documents of every reader, and how a fuzzer changes them: values, keys, bytes.
"""

import copy
import json
import os
import tomllib
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.runner.journal import case_rows
from benchmarks.suites.frozen import parse_suite
from benchmarks.training.preset import load_preset
from controllers.policies.document import parsed_document
from pma_gym.data.datasets.dataset_toml import read_description
from pma_gym.documents import parse_json, parse_toml, parse_yaml
from pma_gym.plant.model import ModelError, dump_model, load_model, shipped_models

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

EXAMPLES = int(os.environ.get("PMA_GYM_FUZZ_EXAMPLES", "15"))

fuzzed = settings(
    max_examples=EXAMPLES,
    deadline=None,
    database=None,
    # Fixtures would be shared by the inputs: files are written anew for each.
    suppress_health_check=list(HealthCheck),
)


def contents(pattern):
    return [path.read_bytes() for path in sorted(ROOT.glob(pattern))]


MODELS = [path.read_bytes() for path in shipped_models().values()]
MODEL_TABLES = [tomllib.loads(content.decode()) for content in MODELS]
SUITES = [content for content in contents("benchmarks/suites/*.toml") if b"schema = 2" in content]
SUITE_TABLES = [tomllib.loads(content.decode()) for content in SUITES]
PRESETS = contents("benchmarks/training/presets/*/*.yml")
PRESET_TABLES = [yaml.safe_load(content) for content in PRESETS]
POLICIES = contents("controllers/policies/shipped/*.json")
POLICY_TABLES = [json.loads(content) for content in POLICIES]
DATASETS = [
    {
        "title": "Bench",
        "model": "station",
        "columns": {
            "t": "time_s",
            "U": {"name": "motor_voltage_v", "factor": 0.5, "offset": 1.0},
            "x": {"name": "contraction_mm", "factor": -1.0, "offset": 60.0, "range": [0, 50]},
        },
        "trials": {
            "a.csv": {"order": 1, "note": "first"},
            "b.csv": {"order": 2, "repeat_of": "a.csv"},
        },
    }
]
ROW = {
    "key": "47c5f263b483db2a",
    "suite": "nominal",
    "version": 1,
    "controller": "pid",
    "station": -1,
    "task": "displacement",
    "pressure_kpa": 150,
    "repeat": 0,
    "seed": 395296354,
    "failure": "",
    "unit": "mm",
    "phases": {"displacement": {"rmse": 0.03, "percent_of_range": 0.1, "largest_error": 0.3}},
    "rmse": 0.03,
    "start_rmse": 0.06,
    "steady_rmse": 0.02,
    "effort_v": 1.3,
    "variation_v_per_s": 1.3,
    "saturation_share": 0.0,
    "violation": 0.0,
    "act_us": 6.8,
    "act_us_worst": 54.0,
}


def accepts(read, *given, error=ValueError):
    """Whether a reader takes an input; what it raises besides its own error fails the test."""
    try:
        read(*given)
    except error as refusal:
        # Neither pages of a file's content nor an empty word.
        assert 10 < len(str(refusal)) < 5000
        return False
    return True


PARSERS = {
    "toml": (parse_toml, MODELS),
    "json": (parse_json, POLICIES),
    "yaml": (parse_yaml, PRESETS),
}


@pytest.mark.parametrize("name", PARSERS)
@fuzzed
@given(data=st.data())
def test_bytes(name, data):
    parse, sound = PARSERS[name]
    accepts(parse, data.draw(damaged(sound) | st.binary(max_size=200)), f"file.{name}")


@fuzzed
@given(damaged(MODELS))
def test_bytes_of_models(tmp_path_factory, content):
    path = _file(tmp_path_factory, "model.toml", content)
    accepts(load_model, path, error=ModelError)


@fuzzed
@given(
    st.lists(
        changed([ROW]).map(lambda row: json.dumps(row).encode())
        | damaged([json.dumps(ROW).encode()]),
        max_size=4,
    )
)
def test_journals(tmp_path_factory, lines):
    sound = json.dumps(ROW).encode()
    path = _file(tmp_path_factory, "journal.jsonl", b"\n".join([sound, *lines, sound]))
    rows = list(case_rows(path))
    assert rows[0] == ROW and rows[-1] == ROW


def _file(factory, name, content) -> Path:
    folder = factory.getbasetemp() / "fuzzed"
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_bytes(content)
    return path


def _models(folder, document):
    path = folder / "model.toml"
    path.write_bytes(toml_document(document).encode())
    model = load_model(path)
    # What is read can be written, and reads the same.
    path.write_text(dump_model(model), encoding="utf-8")
    assert load_model(path).effects == model.effects


def _descriptions(folder, document):
    (folder / "dataset.toml").write_bytes(toml_document(document).encode())
    read_description(folder, ["a.csv", "b.csv"])


def _suites(_, document):
    parse_suite("mine.toml", parse_toml(toml_document(document).encode(), "mine.toml"))


def _presets(folder, document):
    path = folder / "mine.yml"
    path.write_bytes(yaml.safe_dump(document).encode("utf-8", "replace"))
    load_preset(str(path), "ppo", next(iter(document), "none"))


def _policies(_, document):
    parsed_document(json.dumps(document).encode())


READERS = {
    "model": (_models, MODEL_TABLES, 13),
    "dataset.toml": (_descriptions, DATASETS, 1),
    "suite": (_suites, sorted(SUITE_TABLES, key=lambda table: len(str(table))), 5),
    # Of its first environment, the one that is read.
    "preset": (_presets, [dict([*table.items()][:1]) for table in PRESET_TABLES], 3),
    "policy": (_policies, POLICY_TABLES, 7),
}
"""What reads a document, sound ones, and every how many odd values a place gets."""


@pytest.mark.parametrize("name", READERS)
@fuzzed
@given(data=st.data())
def test_changed_documents(name, data, tmp_path_factory):
    read, sound, _ = READERS[name]
    path = _file(tmp_path_factory, "any", b"")
    error = (ValueError, TypeError) if name == "suite" else ValueError
    accepts(read, path.parent, data.draw(changed(sound)), error=error)


@pytest.mark.parametrize("name", READERS)
def test_no_value_of_a_wrong_kind_ends_in_a_traceback(name, tmp_path):
    """Every value of a sound document in turn, by every odd value, and left out."""
    read, (sound, *_), step = READERS[name]
    read(tmp_path, sound)
    refused = 0
    for number, place in enumerate(places(sound)):
        for odd in ODD_VALUES[number % step :: step]:
            refused += not accepts(read, tmp_path, put(sound, place, odd))
        accepts(read, tmp_path, without(sound, place))
    assert refused > 100
