"""Damaged results are computed anew with one warning; sound cases beside them stay."""

import json

import pytest

from benchmarks.hidden_effects.generation.cases import Block
from benchmarks.hidden_effects.run_blocks import Order, run_block
from benchmarks.runner.journal import JOURNAL, case_rows
from benchmarks.runner.provenance import RUN, check_run, finished_rows, read_run
from benchmarks.suites.suite import SuiteError
from benchmarks.tuning.loop_margins import KeptRows
from controllers.design.designs import Gains
from tests.benchmarks.hidden_effects.cheap_diagnosis import by_size
from tests.fuzz.test_fuzz_documents import ROW

RUBBISH = {
    "empty": b"",
    "half": b'{"block": "noth',
    "brace": b"{",
    "object": b"{}",
    "list": b"[]",
    "number": b"3",
    "null": b"null",
    "NaN": b'{"block": NaN, "seed": NaN, "suite": NaN, "number": NaN}',
    "types": b'{"block": 3, "seed": "4", "suite": 3, "contenders": [], "number": []}',
    "two glued": b'{"block": "nothing", "seed": 4}{"block": "nothing", "seed": 4}',
    "binary": bytes(range(256)),
    "deep": b"[" * 100_000,
    "digits": b'{"seed": ' + b"9" * 5000 + b"}",
    "UTF-16": "{}".encode("utf-16"),
}


KINDS_OF_RUBBISH = ("half", "list", "types")
"""No JSON, another kind of value, and an object of other values: one reader parses them all."""


def order(folder):
    return Order(
        block=Block("nothing", trials=3, seconds=2.0), count=3, seed=4, folder=folder, judge=by_size
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    run_block(order(folder))
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def folder(whole, tmp_path):
    for name, content in whole.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    return tmp_path


def warnings_in(text):
    return [line for line in text.splitlines() if line.startswith("warning: ")]


@pytest.mark.parametrize("rubbish", KINDS_OF_RUBBISH)
def test_a_damaged_set_is_written_anew(folder, rubbish, capsys):
    (folder / "set.json").write_bytes(RUBBISH[rubbish])
    before = (folder / "cases/case_0001.json").stat().st_mtime_ns
    assert run_block(order(folder))
    said = capsys.readouterr().err
    assert len(warnings_in(said)) == 1 and "3 are done" in said
    assert (folder / "cases/case_0001.json").stat().st_mtime_ns == before
    assert json.loads((folder / "set.json").read_text()) == {"block": "nothing", "seed": 4}


@pytest.mark.parametrize("rubbish", KINDS_OF_RUBBISH)
def test_damaged_cases_are_made_anew_and_the_others_stay(folder, whole, rubbish, capsys):
    path, other = folder / "cases/case_0002.json", folder / "cases/case_0001.json"
    path.write_bytes(RUBBISH[rubbish])
    before = other.stat().st_mtime_ns
    assert run_block(order(folder))
    said = capsys.readouterr().err
    assert len(warnings_in(said)) == 1 and "case_0002.json" in said and "2 are done" in said
    assert other.stat().st_mtime_ns == before
    again = json.loads(path.read_text())
    assert again["truth"] == json.loads(whole[path.relative_to(folder)])["truth"]


@pytest.mark.parametrize("key", ["truth", "answer", "rounds", "seconds", "number", "code"])
@pytest.mark.parametrize("value", [3, {"seed": 4}])
def test_a_record_of_another_form_is_made_anew(folder, key, value):
    path = folder / "cases/case_0003.json"
    record = json.loads(path.read_text())
    path.write_text(json.dumps(record | {key: value}))
    document = run_block(order(folder))
    assert document is not None and not document["failures"]


@pytest.mark.parametrize("rubbish", RUBBISH)
def test_damaged_run_files_and_lines_cost_no_sound_row(tmp_path, rubbish, capsys):
    (tmp_path / RUN).write_bytes(RUBBISH[rubbish])
    known = read_run(tmp_path)
    assert known in ({}, json.loads(RUBBISH[rubbish]) if known else {})
    assert finished_rows(tmp_path) == []
    assert len(warnings_in(capsys.readouterr().err)) == (not known and rubbish != "object")
    with pytest.raises(SuiteError, match="is damaged .* a run writes it anew: python"):
        check_run(tmp_path, known, "nominal")
    sound = json.dumps(ROW).encode()
    lines = [sound, RUBBISH[rubbish], sound[: len(sound) // 2], sound + sound, b"", sound]
    (tmp_path / JOURNAL).write_bytes(b"\n".join(lines))
    assert list(case_rows(tmp_path / JOURNAL)) == [ROW, ROW]
    assert 1 <= len(warnings_in(capsys.readouterr().err)) <= 2


def test_rows_of_another_schema_count_as_not_run(tmp_path, capsys):
    others = [{"schema": 1}, ROW | {"phases": []}, ROW | {"rmse": None}, ROW | {"failure": 3}]
    lines = [json.dumps(row) for row in [ROW, *others, {"key": None} | ROW]]
    (tmp_path / JOURNAL).write_text("\n".join(lines))
    assert list(case_rows(tmp_path / JOURNAL)) == [ROW, ROW]
    said = warnings_in(capsys.readouterr().err)
    assert len(said) == 1 and "and 3 more" in said[0]


def test_damaged_rows_of_gains_are_tuned_anew_and_the_others_stay(tmp_path, capsys):
    kept = KeptRows(tmp_path / "gains.toml", {"seed": 1})
    gains = [0.5] * len(Gains._fields)
    rows = {"sound": [gains, 1.0], "short": [gains[1:], 1.0], "text": [gains[:-1] + ["x"], 1.0]}
    rows |= {"none": None, "cost": [gains, None]}
    kept.path.write_text(json.dumps({"made_with": kept.made_with, "rows": rows}))
    assert KeptRows(tmp_path / "gains.toml", {"seed": 1}).rows == {"sound": (Gains(*gains), 1.0)}
    said = warnings_in(capsys.readouterr().err)
    assert len(said) == 1 and "4 rows are computed anew" in said[0]
    for content in RUBBISH.values():
        kept.path.write_bytes(content)
        assert KeptRows(tmp_path / "gains.toml", {"seed": 1}).rows == {}
