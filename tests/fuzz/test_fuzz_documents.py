"""Any bytes become a value or the reader's own ValueError: no traceback, no hang, no gigabytes.

PMA_GYM_FUZZ_EXAMPLES sets how many inputs each reader gets; `make fuzz` gives many.
"""

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
from benchmarks.training.preset import PresetError, load_preset
from controllers.policies.document import PolicyError, parsed_document
from controllers.policies.tensors import check_header
from pma_gym.data.datasets.dataset_toml import read_description
from pma_gym.data.trial_columns import TrialError
from pma_gym.documents import parse_json, parse_toml, parse_yaml
from pma_gym.plant.model import ModelError, dump_model, load_model, shipped_models
from tests.fuzz.documents import (
    ODD_VALUES,
    ROOT,
    changed,
    damaged,
    places,
    put,
    toml_document,
    without,
)

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
WEIGHTS = [content[:4096] for content in contents("controllers/policies/shipped/*.safetensors")]
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


@fuzzed
@given(damaged(MODELS) | st.binary(max_size=200))
def test_toml(content):
    accepts(parse_toml, content, "file.toml")


@fuzzed
@given(damaged(POLICIES) | st.binary(max_size=200))
def test_json(content):
    accepts(parse_json, content, "file.json")


@fuzzed
@given(damaged(PRESETS) | st.binary(max_size=200))
def test_yaml(content):
    accepts(parse_yaml, content, "file.yml")


@fuzzed
@given(changed(MODEL_TABLES))
def test_models(tmp_path_factory, document):
    path = _file(tmp_path_factory, "model.toml", toml_document(document).encode())
    if accepts(load_model, path, error=ModelError):
        # What is read can be written, and reads the same.
        model = load_model(path)
        path.write_text(dump_model(model), encoding="utf-8")
        assert load_model(path).effects == model.effects


@fuzzed
@given(damaged(MODELS))
def test_bytes_of_models(tmp_path_factory, content):
    path = _file(tmp_path_factory, "model.toml", content)
    accepts(load_model, path, error=ModelError)


@fuzzed
@given(changed(DATASETS))
def test_descriptions_of_data_sets(tmp_path_factory, document):
    path = _file(tmp_path_factory, "dataset.toml", toml_document(document).encode())
    accepts(read_description, path.parent, ["a.csv", "b.csv"], error=TrialError)


@fuzzed
@given(changed(SUITE_TABLES))
def test_suites(document):
    content = toml_document(document).encode()

    def read():
        parse_suite("mine.toml", parse_toml(content, "mine.toml"))

    accepts(read, error=(ValueError, TypeError))


@fuzzed
@given(changed(PRESET_TABLES))
def test_presets(tmp_path_factory, document):
    content = yaml.safe_dump(document, allow_unicode=False).encode("utf-8", "replace")
    path = _file(tmp_path_factory, "mine.yml", content)
    for environment in ("pma_gym/IsokineticDisplacement-v0", "pma_gym/IsokineticExercise-v0"):
        for algorithm in ("ppo", "sac"):
            accepts(load_preset, str(path), algorithm, environment, error=PresetError)


@fuzzed
@given(changed(POLICY_TABLES))
def test_policies(document):
    content = json.dumps(document).encode()
    accepts(parsed_document, content, error=PolicyError)


@fuzzed
@given(damaged(WEIGHTS), st.integers(0, 1 << 40))
def test_headers_of_weights(content, size):
    accepts(check_header, content, size)


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
    load_model(path)


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
    "model": (_models, MODEL_TABLES[0], 13),
    "dataset.toml": (_descriptions, DATASETS[0], 1),
    "suite": (_suites, min(SUITE_TABLES, key=lambda table: len(str(table))), 5),
    # Of its first environment, the one that is read.
    "preset": (_presets, dict(list(PRESET_TABLES[0].items())[:1]), 3),
    "policy": (_policies, POLICY_TABLES[0], 7),
}


@pytest.mark.parametrize("name", READERS)
def test_no_value_of_a_wrong_kind_ends_in_a_traceback(name, tmp_path):
    """Every value of a sound document in turn, by every odd value, and left out."""
    read, sound, step = READERS[name]
    read(tmp_path, sound)
    refused = 0
    for number, place in enumerate(places(sound)):
        for odd in ODD_VALUES[number % step :: step]:
            refused += not accepts(read, tmp_path, put(sound, place, odd))
        accepts(read, tmp_path, without(sound, place))
    assert refused > 100
