"""The files of a run: they parse, agree with each other, and need nothing from outside."""

import csv
import json
import re

import pytest
from rich.console import Console
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.executors.executor import ThisProcess
from benchmarks.reproduction.replay import ReplayError
from benchmarks.reproduction.replay_page import displacement_verdict
from benchmarks.reproduction.reproduce import report_again, run_job, targets_again
from benchmarks.reproduction.results import CSV_COLUMNS, FIGURES, Results
from benchmarks.reproduction.tables import columns
from benchmarks.runner.controller_spec import ControllerSpec, parse_controllers
from benchmarks.runner.provenance import git_state
from benchmarks.suites.frozen import load_suite
from benchmarks.suites.suite import SuiteError
from pma_gym.pages.document import Heading, Paragraph, Picture, TextTable, to_html, to_markdown
from pma_gym.terminal import SafeConsole

CONTROLLER = """
class Half:
    name = "half"

    def reset(self, reference, station):
        if station.pressure > 500e3:
            raise RuntimeError("no such <pressure>")
        self.volts = 0.13 if station.task.name == "displacement" else 0.0

    def act(self, observation, time):
        return 1e3 * self.volts * 0.005 * time
"""


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """The replay and a controller of one's own, one case of which fails."""
    path = tmp_path_factory.mktemp("controllers") / "half.py"
    path.write_text(CONTROLLER)
    suite = load_suite()
    controllers = [suite.controllers[0], ControllerSpec("Half", path=str(path))]
    return suite.select(["serres2008"], controllers, ["displacement"], [350, 550])


@pytest.fixture(scope="module")
def run(tmp_path_factory, suite):
    """A small run."""
    folder = tmp_path_factory.mktemp("run")
    with (folder / "terminal.txt").open("w") as terminal:
        code = run_job(suite, folder / "out", ThisProcess(), SafeConsole(file=terminal, width=120))
    return code, folder / "out", (folder / "terminal.txt").read_text()


@pytest.fixture
def document(run):
    return json.loads((run[1] / "scores.json").read_text())


@pytest.fixture
def rows(run):
    with (run[1] / "scores.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_failed_case_is_told_and_costs_the_exit_code(run, rows):
    code, _, terminal = run
    assert code == 1
    assert "no such <pressure>" in terminal and "failed" in terminal
    # Words and no markup.
    assert "[/]" not in terminal
    failed = [row for row in rows if row["failure"]]
    assert [(row["controller"], row["pressure_kpa"]) for row in failed] == [("Half", "550")]
    assert failed[0]["rmse"] == ""


def test_columns_are_headed_by_the_controllers_own_names(tmp_path):
    path = tmp_path / "half.py"
    path.write_text(CONTROLLER)
    (half,) = parse_controllers(f"{path}:Half")
    suite = load_suite().select(["serres2008"], [half], ["displacement"], [350])
    results = Results(suite)
    assert list(columns(results, "serres2008", "displacement", "displacement")) == [
        "Measured",
        "half",
    ]


def test_csv_and_json_hold_the_same_figures(rows, document):
    assert tuple(rows[0]) == CSV_COLUMNS
    assert len(rows) == len(document["scores"]) == 4
    for row, score in zip(rows, document["scores"], strict=True):
        assert float(row["pressure_kpa"]) == score["pressure_kpa"]
        for name in FIGURES if score["phases"] else ():
            assert float(row[name]) == score["phases"]["displacement"][name]


def test_json_says_what_it_was_made_with(document):
    assert document["complete"] is True
    assert document["suite"]["seed"] == load_suite().seed
    assert document["suite"]["selected"] is True
    run = document["run"]
    assert set(run["versions"]) == {"python", "numpy", "scipy", "llvmlite", "gymnasium", "pma_gym"}
    assert set(run["git"]) == {"commit", "dirty"}
    assert run["wall_time_s"] > 0 and run["environment_steps_per_second"] > 0
    assert {target["verdict"] for target in document["targets"]} <= {"met", "missed", "no figure"}


def test_the_replay_differs_from_measured_by_what_is_written(document):
    score = document["scores"][0]["phases"]["displacement"]
    measured = document["measured"][0]["phases"]["displacement"]
    error = document["replay_errors"][0]
    assert error["slope"] == score["slope"] - measured["slope"]
    assert error["pressure_kpa"] == 350


def test_the_page_needs_nothing_from_outside(run):
    page = (run[1] / "report.html").read_text()
    assert page.startswith("<!DOCTYPE html>")
    bare, pictures = re.subn(r"data:image/png;base64,[A-Za-z0-9+/=]+", "picture", page)
    assert pictures == 3
    # What the library's own text holds is left to the browser tests: nothing is loaded there.
    bare = re.sub(r"<script>.*?</script>", "", bare, flags=re.DOTALL)
    assert re.findall(r'src="([^"]*)"', bare) == ["picture"] * 3
    assert not re.search(r"https?:|//[a-z]|@import|<link|url\(", bare)
    assert "no such &lt;pressure&gt;" in page


def test_the_report_is_for_users_and_the_targets_for_maintainers(run, suite):
    _, out, terminal = run
    for text in (terminal, (out / "report.md").read_text()):
        assert "missed" not in text and "Targets" not in text
    checks = targets_again(suite, out, ThisProcess())
    document = json.loads((out / "scores.json").read_text())
    assert [check.what for check in checks] == [each["what"] for each in document["targets"]]
    assert [check.verdict for check in checks] == [each["verdict"] for each in document["targets"]]


def figures_of(page):
    """The interactive figures of a page, by name."""
    (text,) = re.findall(r'<script type="application/json" id="figures">(.*?)</script>', page)
    return {figure["name"]: figure for figure in json.loads(text)}


def test_the_interactive_figures_hold_the_scores(run, document):
    figures = figures_of((run[1] / "report.html").read_text())
    assert list(figures) == ["rmse-displacement", "tracking-displacement", "replay-errors"]
    rmse = {trace["name"]: trace["y"] for trace in figures["rmse-displacement"]["traces"]}
    scores = {(s["controller"], s["pressure_kpa"]): s["phases"] for s in document["scores"]}
    expected = scores["Half", 350]["displacement"]["rmse"]
    assert rmse["Half"] == [pytest.approx(expected, rel=1e-5), None]
    views = figures["tracking-displacement"]["views"]
    assert views[0] == "error at 350 kPa (mm)" and "motor voltage at 350 kPa (V)" in views
    errors = [t for t in figures["tracking-displacement"]["traces"] if t["view"] == views[0]]
    half = next(trace["y"] for trace in errors if trace["name"] == "Half")
    assert sum(y * y for y in half) / len(half) == pytest.approx(expected**2, rel=0.02)


def test_markdown_links_pictures_that_exist(run):
    text = (run[1] / "report.md").read_text()
    links = re.findall(r"\]\((plots/\w+\.png)\)", text)
    assert len(links) == 3
    for link in links:
        assert (run[1] / link).read_bytes().startswith(b"\x89PNG")
    assert "| 350 | 1.350 | 5.40 |" in text


def test_nothing_partly_written_is_left(run):
    names = {path.name for path in run[1].iterdir()}
    made = {"plots", "report.md", "report.html", "scores.csv", "scores.json"}
    assert names == made | {"journal.jsonl", "run.json", "stations.json"}


def test_a_run_goes_on_from_its_journal_and_writes_the_same(run, suite, tmp_path):
    """Killed after one of its cases: the others run, and all files are as without the kill."""
    folder = tmp_path / "out"
    folder.mkdir()
    lines = (run[1] / "journal.jsonl").read_text().splitlines(keepends=True)
    (folder / "journal.jsonl").write_text(lines[0] + lines[1][:100])
    with (tmp_path / "terminal.txt").open("w") as terminal:
        assert run_job(suite, folder, ThisProcess(), Console(file=terminal, width=200)) == 1
    assert "1 cases are done in" in (tmp_path / "terminal.txt").read_text()
    for name in ("scores.csv", "plots/tracking_displacement.png"):
        assert (folder / name).read_bytes() == (run[1] / name).read_bytes()
    document = json.loads((folder / "scores.json").read_text())
    assert document["run"]["cases_reused"] == 1
    (whole,) = (each for each in document["targets"] if each["what"] == "whole job")
    assert whole["verdict"] == "no figure"


def test_the_report_is_written_again_from_the_journal_alone(run, suite, tmp_path):
    page = report_again(suite, run[1], tmp_path / "page", ThisProcess())
    assert page.read_bytes() == (run[1] / "report.html").read_bytes()
    with pytest.raises(SuiteError, match=r"lacks 4 of 4 cases .*; run them: python -m benchmarks"):
        report_again(suite, tmp_path / "nothing", tmp_path / "page", ThisProcess())


def test_blocks_are_escaped_and_marked_up():
    blocks = [
        Heading("A <b>", 1),
        Paragraph("**bold** `code` & more"),
        TextTable("t", ["p", "A | mm", "A | %"], [["1", "2", "3"], [""], ["mean", "2", "3"]]),
        Picture("missing", "never drawn"),
    ]
    page = to_html(blocks, {})
    assert "<title>A &lt;b&gt;</title>" in page
    assert "<strong>bold</strong> <code>code</code> &amp; more" in page
    assert '<th class="group" colspan="2">A</th>' in page
    assert '<tr class="ruled"><th data-name="p">mean</th><td data-name="A, mm">2</td>' in page
    text = to_markdown(blocks, {}, "plots")
    assert "| p | A<br>mm | A<br>% |" in text
    assert "never drawn" not in page + text


@pytest.mark.parametrize(
    ("slope", "rmse", "verdict"),
    [
        (0.1, 0.1, "all three figures better"),
        (0.5, 0.5, "the intercept better than the simple prediction, the slope and the RMSE not"),
    ],
)
def test_the_verdict_follows_the_errors(slope, rmse, verdict):
    results = Results(load_suite())
    error = ReplayError("displacement", "displacement", 150, slope, 0.5, 0.0, rmse, 0.1, 0.1)
    assert verdict in displacement_verdict(results, [error])


def test_a_folder_outside_git_has_no_commit(tmp_path):
    assert git_state(tmp_path) == {"commit": "unknown", "dirty": None}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--pressures", "low"], "--pressures must be numbers in kPa by commas, got 'low'"),
        (["--pressures", "310"], "no trial at 310 kPa"),
        (["--task", "lifting"], "task must be displacement or rotation, got 'lifting'"),
        (["--model", "statoin"], "no model 'statoin'"),
        (["--controllers", "pdi"], "no controller 'pdi'"),
        (["--out", __file__], "is a file; name a folder"),
        (["--jobs", "0"], "'--jobs'"),
    ],
)
def test_what_cannot_be_run_ends_in_one_message(arguments, message):
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2
    assert message in done.stderr
    assert done.stdout == ""
