"""A run loses nothing: killed or interrupted it goes on, and ends with the same bits."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.comparison.compare import compare
from benchmarks.comparison.job import chosen, run_comparison
from benchmarks.executors.executor import ProcessDied, ThisProcess
from benchmarks.runner import fingerprint, provenance
from benchmarks.runner.case import cases, failed_row
from benchmarks.runner.execution import execute, pending_cases
from benchmarks.runner.journal import JOURNAL, Journal, case_rows
from benchmarks.runner.provenance import finished_rows, read_run
from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.suite import SuiteError
from tests.fuzz.test_fuzz_documents import ROW

ONE = ThisProcess()
ROOT = Path(__file__).parents[3]

SUITE = """
schema = 2
name = "small"
title = "A few cases"
version = 1
seed = 7
model = "station"
[environment]
control_rate_hz = 100.0
[stations]
of = "robust"
count = 2
nominal = true
[[episodes]]
tasks = ["displacement"]
pressures_kpa = [200, 300, 400]
per_station = 2
[[controllers]]
name = "pid"
title = "PID"
"""

MINE = """
class {name}:
    name = "mine"
    def reset(self, reference, station):
        self.reference, self.volts = reference, 0.0
    def act(self, observation, now):
        self.volts += 20.0 * (self.reference(now) - observation.extension)
        return min(max(self.volts, 0.0), 10.0)
"""


@pytest.fixture
def suite(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SUITE)
    return frozen_suite(str(path))


def own(folder, name):
    path = folder / f"{name}.py"
    path.write_text(MINE.format(name=name))
    return f"{path}:{name}"


def run(suite, controllers, out, executor=ONE):
    words = io.StringIO()
    entries = chosen(suite, controllers)
    code = run_comparison(suite, entries, out, executor, Console(file=words, width=200))
    return code, words.getvalue()


def test_a_line_torn_by_a_crash_costs_its_case_alone(tmp_path):
    path = tmp_path / JOURNAL
    with Journal(path) as journal:
        journal.append(ROW)
    with path.open("ab") as torn:
        torn.write(json.dumps(ROW).encode()[:40])
    assert list(case_rows(path)) == [ROW]
    with Journal(path) as journal:
        journal.append(ROW | {"station": 3})
    assert list(case_rows(path)) == [ROW, ROW | {"station": 3}]
    assert list(case_rows(tmp_path / "nothing")) == []


def test_only_what_was_made_with_the_same_is_used_again(suite, tmp_path, monkeypatch):
    mine, out = own(tmp_path, "Mine"), tmp_path / "out"
    assert run(suite, f"pid,{mine}", out)[0] == 0
    entries = chosen(suite, f"pid,{mine}")
    assert not pending_cases(suite, entries, out).missing
    (tmp_path / "Mine.py").write_text(MINE.format(name="Mine") + "# another\n")
    changed = pending_cases(suite, entries, out)
    assert {case.spec.name for case in changed.missing} == {"Mine"}
    assert (len(changed.known), changed.outdated) == (6, 6)
    for module in (fingerprint, provenance):
        monkeypatch.setattr(module, "code_digest", lambda: "another")
    assert len(pending_cases(suite, entries, out).missing) == 12
    _, words = run(suite, "pid", out)
    assert f"6 rows in {out / JOURNAL} were made with other options" in " ".join(words.split())
    assert "--out names another folder" in words
    # What was made with other code is not compared with what is made now.
    assert {row["controller"] for row in finished_rows(out)} == {"pid"}


def is_package(name):
    return (ROOT / name.replace(".", "/")).is_dir()


def test_a_figure_depends_on_no_file_that_its_key_leaves_out():
    code = "import sys, benchmarks.runner.case\nprint(*sys.modules)"
    listed = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    files = {
        f"{name.replace('.', '/')}.py"
        for name in listed.stdout.split()
        if name.startswith("benchmarks.") and not is_package(name)
    }
    # What a suite asks of its controllers moves no figure.
    assert files - {"benchmarks/suites/suite.py"} <= set(fingerprint.SOURCES)
    assert all(list(ROOT.glob(pattern)) for pattern in fingerprint.SOURCES)


def test_a_later_run_adds_controllers_to_the_same_folder(suite, tmp_path):
    mine, out = own(tmp_path, "Mine"), tmp_path / "out"
    run(suite, "pid", out)
    code, words = run(suite, mine, out)
    assert code == 0 and "mine" in words
    assert {row["controller"] for row in finished_rows(out)} == {"pid", "Mine"}
    known = read_run(out)
    assert known["contenders"]["Mine"]["title"] == "mine"
    assert known["suite"]["digest"] == suite.digest
    assert {"git", "versions", "platform"} <= set(known)
    stations = json.loads((out / "stations.json").read_text())
    assert [one["station"] for one in stations] == [-1, 0, 1]
    assert stations[1]["parameters"]["drive"]["gain_n_per_v"] > 0.0


def test_what_fails_is_a_row_with_its_reason(suite, tmp_path):
    path = tmp_path / "fails.py"
    path.write_text(MINE.format(name="Fails").replace("self.volts +=", "1 / 0 #"))
    code, words = run(suite, f"{path}:Fails", tmp_path / "out")
    assert code == 1
    rows = list(case_rows(tmp_path / "out" / JOURNAL))
    assert len(rows) == 6 and len({row["failure"] for row in rows}) == 1
    reason = "act raised ZeroDivisionError: division by zero (line 7 of fails.py, at 0 s)"
    assert rows[0]["failure"] == f"ControllerError: {reason}"
    assert f"Fails/-1/displacement/200/0 and 5 more: {reason}" in words


def test_a_case_whose_process_died_is_run_again(suite, tmp_path):
    entries = chosen(suite, "pid")
    todo = pending_cases(suite, entries, tmp_path)
    with Journal(tmp_path / JOURNAL) as journal:
        for case in todo.cases[:2]:
            row = failed_row(case, ProcessDied(-9, again=True))
            journal.append(row | {"key": todo.keys["pid"]})
        journal.append(failed_row(todo.cases[2], ValueError("no")) | {"key": todo.keys["pid"]})
    assert len(pending_cases(suite, entries, tmp_path).missing) == 5


def test_a_full_disk_ends_the_run_with_what_is_there(suite, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "write", lambda file, line: len(line) // 2)
    with pytest.raises(OSError, match="bytes of a row could be written"):
        execute(
            pending_cases(suite, chosen(suite, "pid"), tmp_path),
            ThisProcess(),
            tmp_path,
            lambda row: None,
        )


def test_all_means_the_controllers_of_the_suite(suite):
    assert [entry.spec.title for entry in chosen(suite, "all")] == ["PID"]
    assert len(cases(suite, suite.entries)) == 6


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--suite", "robst"], "error: no suite 'robst'"),
        (["--suite", "nominal", "--controllers", "pd"], "error: no controller 'pd'"),
        (["--suite", "nominal", "--out", "{0}/file"], "file is a file; name a folder"),
        (["--suite", "nominal", "--out", "{0}"], "has results of suite other; name another"),
    ],
)
def test_bad_input_is_one_message_and_exit_code_2(options, message, tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "run.json").write_text('{"suite": {"name": "other"}}')
    done = CliRunner().invoke(app, ["run", *(text.format(tmp_path) for text in options)])
    assert done.exit_code == 2 and done.stdout == ""
    assert message in done.stderr and done.stderr.count("\n") == 1


def test_a_quick_look_is_a_part_of_the_whole_and_says_who_is_better(tmp_path):
    path, out, other = tmp_path / "six.toml", tmp_path / "out", tmp_path / "other"
    path.write_text(SUITE.replace("count = 2\nnominal = true", "count = 6"))
    suite = frozen_suite(str(path))
    quick = suite.part(5, ["displacement"])
    assert run(quick, "pid,improved_feedforward", out)[0] == 0
    line = compare("improved_feedforward", "pid", out)
    assert line.startswith("PID is better than improved_feedforward: the error of improved_feed")
    assert line.endswith("PID has the smaller one in 10 of 10 cases of displacement")
    assert run(quick, "improved_feedforward", other)[0] == 0
    assert line == compare(f"{out}:pid", str(other), task="displacement").replace(
        f" of {out}", ""
    ).replace(f" of {other}", "")
    # The whole goes on from the part; compared is what both ran.
    code, words = run(suite, "pid", out)
    assert code == 0 and "10 cases are done" in words
    assert compare("pid", "improved_feedforward", out) == line
    for sides, message in {
        ("pid", "mpc"): "has no results of mpc; it has pid, improved_feedforward",
        ("pid", str(out)): f"has pid, improved_feedforward; name one as {out}:pid",
    }.items():
        with pytest.raises(SuiteError, match=message):
            compare(*sides, out)
    with pytest.raises(SuiteError, match="has 6 stations, got --stations 7"):
        suite.part(7)
    with pytest.raises(SuiteError, match="has the tasks displacement, got --task rotation"):
        suite.part(tasks=["rotation"])


def test_time_series_are_one_table_a_case_that_says_what_its_row_says(suite, tmp_path):
    out, part = tmp_path / "out", suite.part(1)
    assert run(part, "pid", out)[0] == 0 and not (out / "traces").exists()
    # Cases without their series count as not run.
    entries = chosen(part, "pid")
    assert run_comparison(part, entries, out, ONE, Console(quiet=True), "csv") == 0
    rows = {row["pressure_kpa"]: row for row in finished_rows(out)}
    assert len(rows) == 2
    for kpa, row in rows.items():
        series = np.genfromtxt(
            out / "traces" / f"pid--1-displacement-{kpa:g}-0.csv", delimiter=",", names=True
        )
        units = [name.rpartition("_")[2] for name in series.dtype.names]
        assert units == ["s", "mm", "mm", "mm", "v", "v", "v", "mm", "deg", "n", "kpa"]
        error = series["true_position_mm"] - series["reference_mm"]
        assert np.sqrt(np.mean(error**2)) == pytest.approx(row["rmse"], rel=0.01)
        lag = series["measured_position_mm"] - series["true_position_mm"]
        assert 0.0 < np.abs(lag).max() < 0.5
    assert not pending_cases(part, entries, out, "csv").missing
    assert len(pending_cases(part, entries, out, "parquet").missing) == 2


def test_suites_lists_what_can_be_run():
    done = CliRunner().invoke(app, ["suites"])
    assert done.exit_code == 0
    for name in ("reproduction", "nominal", "robust", "hard", "pressure"):
        assert name in done.stdout
