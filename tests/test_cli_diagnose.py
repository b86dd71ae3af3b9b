"""`pma-gym diagnose` and `fit` around a stand-in for the engine: files, exit codes, messages."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.files.trial_files import read_trial, write_trial
from pma_gym.data.trial import Trial
from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.result.estimates import Estimate, Moved
from pma_gym.discovery.result.misfit import Gap, Place
from pma_gym.discovery.result.next_experiment import NextExperiment
from pma_gym.discovery.result.noise import Judgement
from pma_gym.plant.model import load_model
from tests.effects.test_user_effects import DRAG

TIME = np.arange(20) / 10
TRIAL = Trial(TIME, {"motor_voltage": TIME}, {"load": 98.0 * TIME})
DIAGNOSIS = Diagnosis(
    verdict="parameters",
    sentence="The drive pulls 3 % less than the model says.",
    where=(Place("load_n", "above 100 N", 0.7, 0.002),),
    effects=(),
    parameters={"drive.gain_n_per_v": Moved(97.84, Estimate(95.02, 94.1, 95.9, "N/V"), True)},
    gap={"load_n": Gap(5.0, 0.6, 0.6, 0.5, True)},
    candidates=(),
    next_experiment=NextExperiment("Staircase", ("creep",), 40.0, 1.5, TRIAL),
    model=load_model("serres2008").replace({"drive.gain_n_per_v": 95.02}),
    given=load_model("serres2008"),
    not_identifiable={"rotor.inertia_kg_m2": "no trial is fast enough"},
    warnings=("Only one trial.",),
)


@pytest.fixture(autouse=True)
def lab(tmp_path):
    """A data set `lab` in the folder of the command."""
    (tmp_path / "lab").mkdir()
    write_trial(TRIAL, tmp_path / "lab" / "ramp.csv")


@pytest.fixture
def engine(monkeypatch):
    """A stand-in that finds `answer`, or raises it; remembers what it was given."""

    class Engine:
        answer = DIAGNOSIS
        calls = []

        def __call__(self, trials, model=None, *, progress=None, journal=None, **rest):
            self.calls.append((trials, model, rest))
            progress("Noise", 0, 1)
            progress("Noise", 1, 1)
            if journal:
                journal.mkdir(exist_ok=True)
                (journal / "1.json").write_text("{}")
            if isinstance(self.answer, BaseException):
                raise self.answer
            return self.answer

    fake = Engine()
    fake.calls = []
    for name in ("diagnose", "refit"):
        monkeypatch.setattr(f"pma_gym.discovery.{name}", fake, raising=False)
    return fake


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_diagnose_writes_its_files_and_says_what_it_found(run, engine, tmp_path):
    code, out, err = run("diagnose", "lab", "--model", "serres2008", "--seed", "3", "--jobs", "2")
    assert (code, err) == (0, "Noise ...\n")
    ((trials, model, rest),) = engine.calls
    assert (len(trials), model.name, rest) == (1, "serres2008", {"seed": 3, "jobs": 2})
    folder = tmp_path / "lab-diagnosis"
    results = ["diagnosis.json", "model.toml", "next.csv", "report.html", "trials.toml"]
    assert names(folder) == results
    assert json.loads((folder / "diagnosis.json").read_text())["verdict"] == "parameters"
    amended = load_model(folder / "model.toml")
    assert amended.values_in_files("drive")["gain_n_per_v"] == pytest.approx(95.02)
    assert len(read_trial(folder / "next.csv")) == 20
    assert "Seed" in (folder / "report.html").read_text()
    assert out.splitlines() == [
        "Parameters were off.",
        DIAGNOSIS.sentence,
        "",
        "Note: Only one trial.",
        "Where:      load, above 100 N: 70 % of its misfit (p = 0.002)",
        "Parameters: drive.gain_n_per_v from 97.84 to 95.02 N/V (95 %: 94.10 to 95.90)",
        "Misfit:     load 5 N as given, 0.6 refitted, 0.6 proposed (held out), noise 0.5; "
        "98 % of the gap closed",
        "Now:        Use the refitted model, model.toml; no new effect is needed.",
        "            Check on the rig why drive.gain_n_per_v differs.",
        "            These trials cannot show creep. To rule that out, run next.csv on "
        "the rig (staircase; 90 s), save its log into the data set under a new name, and diagnose "
        "again.",
        "Written to lab-diagnosis: diagnosis.json, report.html, next.csv, trials.toml, model.toml",
    ]


@pytest.mark.usefixtures("forget_user_effects")
def test_a_drafted_effect_is_written_and_kept_as_long_as_it_is_loaded(run, engine, tmp_path):
    engine.answer = replace(DIAGNOSIS, draft=DRAG)
    assert run("diagnose", "lab")[0] == 0
    draft = tmp_path / "lab-diagnosis" / "proposed_effect.py"
    draft.write_text(changed := draft.read_text() + "\n# Mine.\n")
    assert run("diagnose", "lab", "--effect", str(draft), "--force")[0] == 0
    assert draft.read_text() == changed


def test_the_model_is_the_data_sets_own_unless_named(run, engine, tmp_path):
    assert run("diagnose", "lab")[0] == 0
    (tmp_path / "lab" / "dataset.toml").write_text('model = "schulz"\ntitle = "Rig 2"')
    assert run("diagnose", "lab", "--out", "two")[0] == 0
    assert run("diagnose", "lab", "--out", "three", "--model", "serres2008")[0] == 0
    assert [model.name for _, model, _ in engine.calls] == ["station", "schulz", "serres2008"]
    assert "Rig 2" in (tmp_path / "two" / "report.html").read_text()


@pytest.mark.parametrize("command", ["diagnose", "fit"])
def test_an_older_result_is_kept_unless_forced(run, engine, tmp_path, command):
    assert run(command, "lab", "--out", "old")[0] == 0
    before = {path: path.read_bytes() for path in (tmp_path / "old").iterdir()}
    code, out, err = run(command, "lab", "--out", "old")
    assert (code, out, len(engine.calls)) == (2, "", 1)
    assert err.startswith("error: old holds an older result (model.toml, ")
    assert "--force replaces it, --out FOLDER writes to another place" in err
    assert before == {path: path.read_bytes() for path in (tmp_path / "old").iterdir()}
    engine.answer = replace(DIAGNOSIS, next_experiment=None)
    assert run(command, "lab", "--out", "old", "--force")[0] == 0
    assert "next.csv" not in names(tmp_path / "old")


def test_ctrl_c_says_how_to_go_on(run, engine, tmp_path):
    engine.answer = KeyboardInterrupt()
    code, out, err = run("diagnose", "lab")
    assert (code, out) == (130, "")
    assert err.endswith("interrupted; the same command with --resume goes on\n")
    assert names(tmp_path / "lab-diagnosis") == ["unfinished"]
    engine.answer = DIAGNOSIS
    code, _, err = run("diagnose", "lab")
    assert code == 2
    assert "lab-diagnosis holds an unfinished run; --resume goes on with it, --force begins" in err
    assert run("diagnose", "lab", "--resume")[0] == 0
    assert "unfinished" not in names(tmp_path / "lab-diagnosis")


_BUSY = """
import hashlib, os, signal, sys, threading
from pma_gym import discovery
from pma_gym.cli import main

def diagnose(*trials, **options):
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)

# A process in the background ignores Ctrl-C, and its children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
discovery.diagnose = diagnose
main(["diagnose", "lab"])
"""


def test_ctrl_c_is_heard_while_compiled_code_runs(run, tmp_path):
    """An integration of many minutes does not return; the process ends all the same."""
    done = subprocess.run(
        [sys.executable, "-c", _BUSY], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr.endswith("interrupted; nothing was finished yet\n")
    assert names(tmp_path) == ["lab"]


def test_ctrl_c_in_a_fit_leaves_nothing(run, engine, tmp_path):
    engine.answer = KeyboardInterrupt()
    code, _, err = run("fit", "lab")
    assert code == 130
    assert "interrupted; nothing was finished yet" in err
    assert names(tmp_path) == ["lab"]


def test_force_begins_an_unfinished_run_anew(run, engine, tmp_path):
    (tmp_path / "lab-diagnosis" / "unfinished").mkdir(parents=True)
    (tmp_path / "lab-diagnosis" / "unfinished" / "old.json").write_text("{}")
    engine.answer = KeyboardInterrupt()
    assert run("diagnose", "lab", "--force")[0] == 130
    assert names(tmp_path / "lab-diagnosis" / "unfinished") == ["1.json"]


@pytest.mark.parametrize("command", ["diagnose", "fit"])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none"], "error: there is no folder none; check the name of the data set"),
        (["lab/ramp.csv"], "error: lab/ramp.csv is a file; a data set is a folder"),
        (["lab", "--model", "statoin"], "did you mean 'station'?"),
        (["lab", "--model", "old.toml"], "old.toml: schema must be 1"),
        (["lab", "--out", "no/where"], "there is no folder no; make it, or name another"),
        (["lab", "--out", "old.toml"], "--out old.toml is no folder"),
        (["lab", "--out", "lab"], "--out lab is the data set itself"),
        (["lab", "--jobs", "0"], "--jobs"),
    ],
)
def test_input_that_cannot_be_used_ends_in_one_message(
    run, engine, tmp_path, command, arguments, message
):
    (tmp_path / "old.toml").write_text("schema = 7\n")
    before = names(tmp_path)
    code, out, err = run(command, *arguments)
    assert (code, out, engine.calls) == (2, "", [])
    assert message in err and "Traceback" not in err
    assert names(tmp_path) == before


def test_what_the_engine_refuses_leaves_nothing(run, engine, tmp_path):
    engine.answer = ValueError("ramp.csv has 3 samples, fewer than the 12 parameters")
    code, _, err = run("fit", "lab")
    assert code == 2
    assert err.endswith("error: ramp.csv has 3 samples, fewer than the 12 parameters\n")
    assert names(tmp_path) == ["lab"]


def test_fit_prints_and_writes_the_parameters(run, engine, tmp_path):
    code, out, err = run("fit", "lab", "--model", "serres2008")
    assert (code, err) == (0, "Noise ...\n")
    assert names(tmp_path / "lab-fit") == ["fit.json", "model.toml", "trials.toml"]
    document = json.loads((tmp_path / "lab-fit" / "fit.json").read_text())
    assert document["parameters"]["drive.gain_n_per_v"]["to"] == 95.02
    assert document["not_identifiable"] == {"rotor.inertia_kg_m2": "no trial is fast enough"}
    assert "candidates" not in document
    (row,) = (line for line in out.splitlines() if "drive.gain_n_per_v" in line)
    for cell in ("97.84", "95.02", "94.10 to 95.90", "N/V", "differs"):
        assert cell in row
    assert "not identifiable: no trial is fast enough" in out
    (row,) = (line for line in out.splitlines() if "load (N)" in line)
    assert [cell for cell in ("5", "0.6", "0.5") if cell in row] == ["5", "0.6", "0.5"]


def test_fit_says_when_parameters_do_not_explain_it_all(run, engine):
    left = Judgement(0.5, "rest segments", 8.0, 6.0, 6.5, 7.0, "misfit")
    engine.answer = replace(DIAGNOSIS, adequacy={"load_n": left})
    code, out, _ = run("fit", "lab")
    assert code == 0
    assert "in noise floors: 8 in load (the noise at rest, 0.5 N)." in out
    engine.answer = DIAGNOSIS
    assert "noise floors" not in run("fit", "lab", "--force")[1]


def test_warnings_of_the_data_set_are_said(run, engine, tmp_path):
    path = tmp_path / "lab" / "ramp.csv"
    path.write_text(path.read_text().replace("load_n", "load_n,Temp", 1).replace("\n", ",1\n"))
    path.write_text(path.read_text().replace("Temp,1", "Temp", 1))
    code, _, err = run("diagnose", "lab")
    assert code == 0
    assert err.startswith("warning: ramp.csv: unknown columns are ignored: 'Temp'\n")


@pytest.mark.parametrize("command", ["diagnose", "fit"])
def test_json_is_printed_instead_of_tables(run, engine, tmp_path, command):
    code, out, _ = run(command, "lab", "--model", "serres2008", "--json")
    name = "diagnosis" if command == "diagnose" else command
    written = (tmp_path / f"lab-{name}" / f"{name}.json").read_text()
    assert code == 0 and json.loads(out) == json.loads(written)
