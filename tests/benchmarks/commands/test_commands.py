"""`python -m benchmarks`: a file that cannot be written is refused before anything runs."""

import os

import pytest
from rich.console import Console
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.executors.choice import local
from benchmarks.reproduction import reproduce
from benchmarks.runner import run
from benchmarks.suites.frozen import load_suite

COMMANDS = ["profiles", "studies", "identify", "tune"]


@pytest.fixture
def nothing_runs(monkeypatch):
    """Every command's work is a failure of the test."""
    from benchmarks import dissertation
    from benchmarks.identification import identify as identification_job
    from benchmarks.tuning import tune

    def runs(*_, **__):
        raise AssertionError("it ran")

    modules = {
        "identify": identification_job,
        "profiles": dissertation,
        "studies": dissertation,
        "tune": tune,
    }
    for name, module in modules.items():
        monkeypatch.setattr(module, f"run_{name}", runs)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("out", "message"),
    [
        ("folder", "folder is a folder; name a file in it"),
        ("nowhere/file", "there is no folder {0}/nowhere; name a file in a folder that exists"),
        ("file/file", "{0}/file is no folder; name a file in a folder"),
        ("pipe", "it is no ordinary file; name another"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_at_once(
    command, out, message, tmp_path, nothing_runs
):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe")
    before = sorted(tmp_path.rglob("*"))
    done = CliRunner().invoke(app, [command, "--out", str(tmp_path / out)])
    assert done.exit_code == 2
    assert done.stdout == "" and done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"error: --out: cannot write {tmp_path / out}: ")
    assert message.format(tmp_path) in done.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_tuning_on_tasks_of_any_rig_keeps_its_settings_in_no_file_of_gains(nothing_runs):
    done = CliRunner().invoke(app, ["tune", "--tasks", "angle_sine", "--out", "gains.toml"])
    assert done.exit_code == 2 and "results/rigs: leave out --out and --only" in done.stderr


def test_ctrl_c_leaves_what_is_done_and_says_how_it_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "compile_kernels", lambda suite: None)
    monkeypatch.setattr(run, "execute", lambda *_: False)
    with (tmp_path / "terminal.txt").open("w") as terminal:
        console = Console(file=terminal, width=200)
        assert reproduce.run_job(load_suite(), tmp_path / "out", local(2), console) == 130
    words = (tmp_path / "terminal.txt").read_text()
    assert "Interrupted: 0 of 153 cases are done and stay in" in words
    assert "The same command goes on from there." in words
    assert not (tmp_path / "out" / "report.html").exists()


def test_ctrl_c_before_the_cases_begin_says_the_same(monkeypatch, tmp_path):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(reproduce, "run_job", interrupted)
    done = CliRunner().invoke(app, ["--out", str(tmp_path)])
    assert done.exit_code == 130
    assert done.stderr.startswith("Interrupted; the same command again goes on")
