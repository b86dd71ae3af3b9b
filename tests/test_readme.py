"""README: its Python runs, its commands exist, its figures are a run's and nobody's."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from statistics import fmean

import pytest
import typer
from typer.testing import CliRunner

import benchmarks.__main__
import pma_gym.cli
from benchmarks import readme_table
from benchmarks.hidden_effects.evaluation.summary import KEPT
from benchmarks.readme_table import FIGURES, RunError, load_run, refreshed
from benchmarks.runner.phase_score import PHASES, measured_score
from benchmarks.suites.frozen import load_suite

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS, RECORD = (
    (ROOT / "docs" / name).read_text(encoding="utf-8")
    for name in ("results.md", "notebook/reproduction.md")
)
FIRST_CONTROLLER = (ROOT / "docs" / "first-controller.md").read_text(encoding="utf-8")
EXAMPLE = ROOT / "docs" / "examples" / "integral.py"


def blocks(language, text=README):
    return re.findall(rf"```{language}\n(.*?)\n```", text, re.DOTALL)


SHOWN = [block for text in (README, RESULTS, FIRST_CONTROLLER) for block in blocks("bash", text)]


def run(*command, cwd):
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, *command], cwd=cwd, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.example
def test_first_code_prints_the_rmse_of_a_pid_and_draws_its_trial(tmp_path):
    (code,) = (block for block in blocks("python") if "gym.make" in block)
    printed = run("-c", code, cwd=tmp_path)
    rmse = re.fullmatch(r"RMSE (\d\.\d{3}) mm\n", printed)
    assert rmse and float(rmse[1]) <= 0.10
    assert (tmp_path / "trial.png").stat().st_size > 10_000


def test_it_is_read_in_minutes():
    words = README.split()
    assert len(words) <= 600 and len(README.split("```")[0].split()) <= 120


def test_example_of_a_controller_is_the_file():
    assert EXAMPLE.read_text(encoding="utf-8").rstrip() in blocks("python", FIRST_CONTROLLER)


@pytest.mark.example
def test_example_of_a_controller_is_scored(tmp_path):
    (command,) = (
        line
        for block in blocks("bash", FIRST_CONTROLLER)
        for line in block.splitlines()
        if "pid,docs/examples/integral.py:Integral --out" in line
    )
    _, controllers, _, out = command.split("-m benchmarks ")[1].split()
    mine = controllers.split(",")[1]
    selection = ["--model", "station", "--task", "rotation", "--pressures", "400"]
    run(*"-m benchmarks --controllers".split(), mine, *selection, "--out", tmp_path / out, cwd=ROOT)
    (score,) = json.loads((tmp_path / out / "scores.json").read_text(encoding="utf-8"))["scores"]
    assert score["controller"] == "Integral" and not score["failure"]
    assert set(score["phases"]) == set(PHASES["rotation"])


def test_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"`make (\w+)`", README))
    assert {"bench", "test"} <= named
    assert all(re.search(rf"^{target}:.*## ", makefile, re.MULTILINE) for target in named)


@pytest.mark.parametrize(
    ("app", "program"),
    [(pma_gym.cli.app, "pma-gym"), (benchmarks.__main__.app, "python -m benchmarks")],
)
def test_commands_exist_with_their_options(app, program):
    lines = re.findall(rf"^.*{program} (.+)$", "\n".join(SHOWN), re.MULTILINE)
    lines += re.findall(rf"`{program} ([^`]+)`", README + RESULTS)
    assert lines
    for line in lines:
        words = line.split()
        called = [] if words[0].startswith("--") else words[:1]
        shown = CliRunner().invoke(app, [*called, "--help"], env={"COLUMNS": "200"})
        assert shown.exit_code == 0, line
        options = [word for word in words if word.startswith("--")]
        assert all(option in shown.output for option in options), line


def test_files_that_it_names_exist():
    links = [link for link in re.findall(r"\]\(([^)]+)\)", README) if "://" not in link]
    assert links and all((ROOT / link).is_file() for link in links)
    (picture,) = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README)
    assert (ROOT / picture).stat().st_size < 1_000_000


def test_the_package_carries_it():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["readme"] == "README.md"


def table(name):
    """Header and rows of a block of figures."""
    _, after = (RESULTS + RECORD).split(f"<!-- figures: {name} -->")
    block = after.split("<!-- end of figures -->")[0]
    lines = [line.strip("| ").split(" | ") for line in block.strip().splitlines()]
    return lines[0], lines[2:]


@pytest.mark.parametrize("task", ["displacement", "rotation"])
def test_table_has_every_trial_and_the_measured_figures(task):
    suite = load_suite()
    header, rows = table(task)
    assert header[:2] == ["Pressure (kPa)", "Measured"]
    assert header[2:] == [controller.title for controller in suite.controllers]
    assert [row[0] for row in rows] == [f"{p:g}" for p in suite.pressures_kpa[task]] + ["mean"]
    figures = [[[float(x) for x in cell.split(" / ")] for cell in row[1:]] for row in rows]
    for pressure, row in zip(suite.pressures_kpa[task], figures[:-1], strict=True):
        measured = [measured_score(task, phase, pressure).rmse for phase in PHASES[task]]
        assert row[0] == pytest.approx(measured, abs=0.006)
    for column, means in enumerate(figures[-1]):
        for phase, mean in enumerate(means):
            assert mean == pytest.approx(
                fmean(row[column][phase] for row in figures[:-1]), abs=0.011
            )


def small_run(**changed):
    """A run of two trials with round figures."""
    suite = {
        **{"name": "reproduction", "version": 1, "selected": False, "seed": 2008},
        **{"control_rate_hz": 100.0, "noise": True, "models": ["station", "cascade"]},
        "controllers": [
            {"name": "pid", "title": "PID"},
            {"name": "serres_replay", "title": "Feed-forward as printed"},
        ],
        "pressures_kpa": {"displacement": [150], "rotation": [275]},
    }
    scores = []
    for task, pressure in (("displacement", 150), ("rotation", 275)):
        for model, rmse in (("station", 0.25), ("cascade", 9.0)):
            parts = {"rmse": rmse, "line_error": 0.6 * rmse, "scatter": 0.8 * rmse}
            phases = {phase: parts for phase in PHASES[task]}
            case = {"model": model, "task": task, "pressure_kpa": pressure, "failure": None}
            scores += [
                case | {"controller": name, "phases": phases} for name in ("pid", "serres_replay")
            ]
    measured = [
        score | {"controller": None}
        for score in scores
        if (score["model"], score["controller"]) == ("station", "pid")
    ]
    whole = {
        **{"complete": True, "suite": suite, "scores": scores, "measured": measured},
    }
    return whole | changed


def test_figures_replace_what_stands_between_the_marks():
    text = "before\n<!-- figures: displacement -->\nold\n<!-- end of figures -->\nafter\n"
    refreshed_text = refreshed(text, small_run())
    assert "| 150 | 0.250 | 0.250 |" in refreshed_text and "old" not in refreshed_text
    assert refreshed_text.startswith("before\n") and refreshed_text.endswith("after\n")
    assert refreshed(refreshed_text, small_run()) == refreshed_text


def test_every_kind_of_figures_can_be_written():
    for name in FIGURES:
        marks = f"<!-- figures: {name} -->\n<!-- end of figures -->"
        assert len(refreshed(marks, small_run())) > len(marks) + 20


def command():
    app = typer.Typer()
    app.command()(readme_table.main)
    return app


def test_figures_that_were_kept_stand_in_the_readme_as_they_are():
    assert "| nothing hidden: an effect claimed |" in README
    assert refreshed(README, None) == README


def test_a_kept_figure_is_written_without_a_run_which_is_left_alone():
    run_only = "<!-- figures: displacement -->\nold\n<!-- end of figures -->\n"
    refreshed_text = refreshed(
        run_only + "<!-- figures: diagnosis -->\n<!-- end of figures -->", None
    )
    assert refreshed_text.startswith(run_only)
    rates = json.loads(KEPT.read_text("utf-8"))["blocks"]["nothing"]["rates"]
    row = next(line for line in refreshed_text.splitlines() if line.startswith("| nothing hidden"))
    assert float(row.split("|")[2].split("%")[0]) == pytest.approx(
        100.0 * rates["false alarm"]["rate"], abs=0.05
    )
    assert row.endswith(f"| {rates['false alarm']['n']} |")


def test_kept_figures_are_checked_without_a_run():
    done = CliRunner().invoke(command(), ["--kept", "--check"])
    assert done.exit_code == 0, done.output


def test_unknown_figures_are_refused():
    with pytest.raises(RunError, match="no figures 'speeed'; there are"):
        refreshed("<!-- figures: speeed -->\n<!-- end of figures -->", small_run())


@pytest.mark.parametrize("changed", [{"complete": False}, {"scores": [{"failure": "no gains"}]}])
def test_a_part_of_a_run_is_refused(tmp_path, changed):
    scores = tmp_path / "scores.json"
    with pytest.raises(RunError, match="there is no file"):
        load_run(scores)
    scores.write_text(json.dumps(small_run(**changed)), encoding="utf-8")
    with pytest.raises(RunError, match="not a whole run of the suite"):
        load_run(scores)
