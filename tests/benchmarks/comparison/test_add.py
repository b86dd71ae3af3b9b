"""Somebody's own controller: scored beside the others, or told in plain words what to mend."""

import json

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.comparison.add import print_clipping
from benchmarks.runner.case import Case, run_case
from benchmarks.runner.controller_spec import ControllerError, ControllerSpec
from benchmarks.runner.isolated_controller import Guarded, LateError
from benchmarks.runner.journal import Journal
from benchmarks.runner.rollout import rollout
from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.suite import NOMINAL, Episode
from pma_gym.envs import PMAEnv

SUITE = """
schema = 2
name = "small"
title = "A few cases"
version = 1
seed = 7
model = "station"
[environment]
control_rate_hz = 100.0
[[episodes]]
tasks = ["displacement"]
pressures_kpa = [200, 300, 400]
repeats = 2
[[controllers]]
name = "pid"
title = "PID"
"""

MINE = """
import time
import numpy as np
class Mine:
    name = "My own"
    def reset(self, reference, station):
        self.reference, self.volts = reference, 0.0
    def act(self, observation, now):
        {body}
        self.volts += 20.0 * (self.reference(now) - observation.extension)
        return min(max(self.volts, 0.0), 10.0)
"""


def own(folder, body):
    path = folder / "mine.py"
    path.write_text(MINE.format(body=body))
    return ControllerSpec("Mine", path=str(path))


def guarded(spec):
    return run_case(Case(frozen_suite("nominal"), spec, Episode(NOMINAL, "displacement", 300, 0)))


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (
            "now > 1.0 and [][3]",
            r"act raised IndexError: list index out of range \(line 9 of mine.py, at 1.01 s\)",
        ),
        (
            "np.linalg.inv(np.zeros((2, 2)))",
            r"act raised LinAlgError: Singular .*line 9 of mine.py",
        ),
        ("raise SystemExit(3)", "act raised SystemExit: 3"),
        ("return float('nan')", "act must return finite volts, 0-10 V, at 0 s it returned nan"),
        ("return np.zeros((1, 2))", "act must return volts as a number.*return float"),
        ("return None", "it returned None"),
    ],
)
def test_what_goes_wrong_is_said_with_where_to_mend_it(body, message, tmp_path):
    with pytest.raises(ControllerError, match=message):
        guarded(own(tmp_path, body))


def test_an_act_slower_than_the_control_period_is_late(tmp_path):
    with pytest.raises(LateError, match="act takes 1.* ms on average over 1 s.*period is 10 ms"):
        guarded(own(tmp_path, "time.sleep(0.0105)"))


def test_one_late_answer_is_forgiven(tmp_path):
    assert not guarded(own(tmp_path, "now == 0.0 and time.sleep(0.5)"))["failure"]


def test_a_guard_lets_everything_through(tmp_path):
    spec = own(tmp_path, "pass")
    environment = PMAEnv("displacement", pressure_kpa=300)
    watched = rollout(environment, Guarded(spec, 0.01), seed=3)
    free = rollout(environment, spec.make(), seed=3)
    assert np.array_equal(watched.position, free.position)
    controller = Guarded(spec, 0.01)
    assert controller.name == "My own"
    assert not hasattr(controller, "repetitions")


def invoke(folder, *arguments):
    options = ["--suite", str(folder / "small.toml"), "--jobs", "1"]
    return CliRunner().invoke(app, [*arguments, *options], env={"COLUMNS": "200"})


def test_it_stands_beside_the_others(tmp_path):
    (tmp_path / "small.toml").write_text(SUITE)
    out = str(tmp_path / "results" / "small")
    assert invoke(tmp_path, "run", "--out", out).exit_code == 0
    spec = own(tmp_path, "pass")
    add = ("add", spec.source, "--results", str(tmp_path / "results"))
    done = invoke(tmp_path, *add)
    assert done.exit_code == 0, done.output
    assert "Suite small version 1:" in done.stdout and "controllers: 6 cases" in done.stdout
    assert "displacement: " in done.stdout and "rank 2 of 2" in done.stdout
    again = invoke(tmp_path, *add)
    assert "6 cases are done in" in again.stdout and "rank 2 of 2" in again.stdout


@pytest.mark.campaign
def test_after_three_failures_the_rest_is_left(tmp_path):
    (tmp_path / "small.toml").write_text(SUITE)
    spec = own(tmp_path, "return 1 / 0")
    done = invoke(tmp_path, "add", spec.source, "--results", str(tmp_path / "results"))
    assert done.exit_code == 1
    assert "3 cases failed: the other 3 are not run" in done.stdout
    assert "and 2 more: act raised ZeroDivisionError: division by zero (line 9" in done.stdout
    assert "Traceback" not in done.output


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("mine.py", "name a file and its class as path/to/file.py:ClassName, got 'mine.py'"),
        ("{0}/none.py:Mine", "there is no file {0}/none.py; check the name and the folder"),
        ("{0}/mine.py:Other", "has no class 'Other'; it has Mine"),
    ],
)
def test_bad_input_is_one_message_and_exit_code_2(source, message, tmp_path):
    own(tmp_path, "pass")
    done = CliRunner().invoke(app, ["add", source.format(tmp_path)])
    assert done.exit_code == 2 and done.stdout == ""
    assert message.format(tmp_path) in done.stderr and done.stderr.count("\n") == 1


SPY = """
import gc, json, sys
from pathlib import Path
class Spy:
    name = "spy"
    def receive(self, environment):
        raise AssertionError("it was shown the environment")
    def reset(self, reference, station):
        kinds = [type(each).__name__ for each in gc.get_objects()]
        frame = sys._getframe()
        while frame:
            kinds += [type(each).__name__ for each in frame.f_locals.values()]
            frame = frame.f_back
        kinds.append(type(getattr(reference, "__self__", None)).__name__)
        Path(__file__).with_suffix(".json").write_text(json.dumps(sorted(set(kinds))))
    def act(self, observation, now):
        return -0.5 if now < 0.1 else 11.0 if now < 0.2 else 3.0
"""


def test_a_controller_from_a_file_finds_no_environment_and_its_clipping_is_counted(tmp_path):
    path = tmp_path / "spy.py"
    path.write_text(SPY)
    row = guarded(ControllerSpec("Spy", path=str(path)))
    kinds = json.loads(path.with_suffix(".json").read_text())
    assert "StationInfo" in kinds and not {"PMAEnv", "PMAVectorEnv", "Engine"} & set(kinds)
    assert row["clipped_share"] == pytest.approx(20 / 501) and row["clipped_v"] == 1.0
    with (tmp_path / "terminal.txt").open("w") as terminal:
        print_clipping([row], Console(file=terminal, width=200))
    assert (
        "Spy: 4 % of its commands were below 0 V or above 10 V, by up to 1 V, in 1 of 1"
        in (tmp_path / "terminal.txt").read_text()
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\nx = 1 / 0\nclass Mine: pass", "ZeroDivisionError: .*line 2 of mine.py"),
        (
            "import deep\nclass Mine:\n def __init__(self):\n  deep.fail()",
            "line 4 of mine.py, which calls line 2 of deep.py",
        ),
    ],
)
def test_a_file_that_raises_before_any_trial_names_its_line(text, message, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "deep.py").write_text("def fail():\n    raise OSError('no')\n")
    (tmp_path / "mine.py").write_text(text)
    with pytest.raises(ControllerError, match=message):
        ControllerSpec("Mine", path=str(tmp_path / "mine.py")).make()


def test_a_controller_is_taken_out_of_a_journal_and_the_others_keep_their_bytes(tmp_path):
    (tmp_path / "small.toml").write_text(SUITE)
    folder = tmp_path / "results" / "small"
    folder.mkdir(parents=True)
    others = b'{"controller": "pid", "rmse": 1e-3}\n{"contr\n\xff\n{"controller": "pid"}'
    mine = b'{"controller": "Mine", "failure": "it broke"}\n'
    journal = folder / "journal.jsonl"
    journal.write_bytes(mine + others[:36] + mine + others[36:])
    entry = {"title": "a", "source": "a.py:A", "key": "a"}
    (folder / "run.json").write_text(json.dumps({"contenders": {"Mine": entry, "pid": entry}}))
    suite = str(tmp_path / "small.toml")
    options = ["--suite", suite, "--results", str(tmp_path / "results")]
    wrong = CliRunner().invoke(app, ["remove", "Mien", *options])
    assert wrong.exit_code == 2
    assert f"no rows of 'Mien' in {journal}; they have rows of Mine, pid; did you mean Mine?" in (
        wrong.stderr
    )
    with Journal(journal):
        busy = CliRunner().invoke(app, ["remove", "Mine", *options])
    assert busy.exit_code == 2 and f"a run is writing to {journal}; wait" in busy.stderr
    before = journal.read_bytes()
    done = CliRunner().invoke(app, ["remove", "Mine", *options])
    assert done.exit_code == 0 and f"{journal}: 2 rows of Mine removed" in done.stdout
    assert journal.read_bytes() == before.replace(mine, b"")
    assert journal.read_bytes().startswith(others)
    assert json.loads((folder / "run.json").read_text())["contenders"] == {"pid": entry}
    assert not list(folder.glob(".*partial"))
