"""`pma-gym` from the shell: what it writes is a log; what it cannot use ends in one message."""

import re
import subprocess
import sys

import numpy as np
import pytest

from pma_gym.data.files.trial_files import read_trial, write_trial
from pma_gym.data.trial import Trial
from pma_gym.metrics import PHASE_SAMPLES, SAMPLE_RATE_HZ

HEADER = "time_s,motor_voltage_v,regulator_voltage_v"
WISHES = "time_s,motor_voltage_v,pressure_command_kpa"
RAMP = f"{HEADER}\n0,0,5\n2,3,5\n4,3,5\n"


@pytest.fixture
def ramp(tmp_path):
    path = tmp_path / "ramp.csv"
    path.write_text(RAMP)
    return path


def test_simulate_writes_the_log(run, ramp, tmp_path):
    code, out, err = run("simulate", "ramp.csv", "--model", "serres2008", "--out", "log.csv")
    assert (code, err) == (0, "")
    assert "3 samples, 4 s, on serres2008 with noise, seed 0: log.csv" in out
    names = (tmp_path / "log.csv").read_text().splitlines()[0]
    assert names == f"{HEADER},contraction_mm,rotation_deg,load_n,pressure_kpa"
    log = read_trial(tmp_path / "log.csv")
    assert np.all(np.diff(log.extension[:2]) > 5e-3)


def test_the_seed_and_the_noise_are_options(run, ramp, tmp_path):
    logs = {}
    for name, options in {
        "first": ["--seed", "1"],
        "again": ["--seed", "1"],
        "other": ["--seed", "2"],
        "quiet": ["--no-noise"],
    }.items():
        assert (
            run("simulate", ramp, "--model", "serres2008", "--out", f"{name}.csv", *options)[0] == 0
        )
        logs[name] = (tmp_path / f"{name}.csv").read_bytes()
    assert logs["first"] == logs["again"]
    assert len({logs["first"], logs["other"], logs["quiet"]}) == 3


def test_commands_are_joined_or_held(run, ramp, tmp_path):
    model = ("--model", "serres2008", "--no-noise")
    loads = {}
    for how in ("foh", "zoh"):
        assert run("simulate", ramp, *model, "--interpolation", how, "--out", f"{how}.csv")[0] == 0
        loads[how] = read_trial(tmp_path / f"{how}.csv").measurements["load"][1]
    # Held, the motor has not yet been told to pull when the second row is logged.
    assert loads["foh"] > 200.0
    assert loads["zoh"] == pytest.approx(0.0, abs=1e-6)


MORE = RAMP.replace("regulator_voltage_v", "regulator_voltage_v,x", 1).replace(",5\n", ",5,1\n")


@pytest.mark.parametrize(
    ("content", "warning"),
    [
        (f"{HEADER}\n0,0,5\n1,0,10\n2,0,10\n", "model serres2008 holds for 150 to 575 kPa"),
        (MORE, "in.csv: unknown columns are ignored: 'x'"),
    ],
)
def test_what_is_doubtful_is_said(run, tmp_path, content, warning):
    (tmp_path / "in.csv").write_text(content)
    code, _, err = run("simulate", "in.csv", "--model", "serres2008", "--out", "log.csv")
    assert code == 0
    assert f"warning: {warning}" in err


@pytest.mark.parametrize(
    ("content", "options", "message"),
    [
        (RAMP, ["--out", "ramp.csv"], "is the command file itself"),
        (RAMP, ["--out", "log.txt"], "must end in .csv, .parquet, .xlsx"),
        (RAMP, ["--out", "nowhere/log.csv"], "there is no folder nowhere"),
        (RAMP, ["--out", "log.csv", "--model", "statoin"], "no model 'statoin'.*did you mean"),
        (RAMP, ["--out", "log.csv", "--interpolation", "cubic"], "'cubic' is not one of"),
        (RAMP, ["--out", "log.csv", "--seed", "-1"], "--seed"),
        (RAMP, [], "Missing option '--out'"),
        ("", ["--out", "log.csv"], "ramp.csv is empty"),
        (f"{HEADER}\n", ["--out", "log.csv"], "no rows"),
        (f"{HEADER}\n0,0,5\n1,full,5\n", ["--out", "log.csv"], "row 3 of ramp.csv has 'full'"),
        (f"{HEADER}\n0,0,5\n1,12.4,5\n", ["--out", "log.csv"], "must lie in 0-10 V, row 3"),
        (f"{HEADER}\n1,0,5\n0,1,5\n", ["--out", "log.csv"], "time_s must increase strictly"),
        (
            "time_s,motor_voltage_v\n0,0\n1,1\n",
            ["--out", "log.csv"],
            "give regulator_voltage_v or pressure_command_kpa",
        ),
        ("t,motor_voltage_v\n0,0\n", ["--out", "log.csv"], "has no column time_s"),
        (
            f"{WISHES}\n0,0,300\n\n1,0,700\n",
            ["--out", "log.csv"],
            "^error: pressure_command_kpa must lie in 0 to 578.6 kPa, .* row 4 of ramp.csv has "
            "700; write gauge pressure in kPa: 1 bar is 100",
        ),
        (f"{WISHES}\n0,0,-1\n", ["--out", "log.csv"], "must lie in 0 to .* row 2 of .* has -1;"),
        (
            f"{WISHES}\n0,0,\n1,0,300\n",
            ["--out", "log.csv"],
            "pressure_command_kpa has no value in row 2 of ramp.csv, the first, .*; fill it in",
        ),
        (
            f"{HEADER}\n0,0,5\n1e9,0,5\n",
            ["--out", "log.csv"],
            "time_s must span 86400 s .*, from row 2 of ramp.csv to row 3 of ramp.csv it is "
            r"1e\+09 s; write seconds: divide milliseconds by 1000",
        ),
        (
            f"{HEADER}\n0,0,5\n1e-9,0,5\n",
            ["--out", "log.csv"],
            "samples must lie 1e-06 s or more apart in time_s, .* it is 1e-09 s on average; write",
        ),
    ],
)
def test_what_cannot_be_simulated_ends_in_one_message(run, tmp_path, content, options, message):
    (tmp_path / "ramp.csv").write_text(content)
    if "--model" not in options:
        options = [*options, "--model", "serres2008"]
    code, out, err = run("simulate", "ramp.csv", *options)
    assert (code, out) == (2, "")
    assert "Traceback" not in err
    assert re.search(message, err)
    assert {path.name for path in tmp_path.iterdir()} == {"ramp.csv"}
    assert (tmp_path / "ramp.csv").read_text() == content


def test_a_file_that_cannot_be_written_is_refused_before_the_run(run, ramp, tmp_path, monkeypatch):
    monkeypatch.setattr("pma_gym.cli.Plant", None)
    (tmp_path / "log.csv").mkdir()
    for out, message in (("log.csv", "log.csv is a folder"), ("none/log.csv", "no folder none;")):
        code, _, err = run("simulate", "ramp.csv", "--out", out)
        assert code == 2
        assert re.search(f"^error: cannot write {out}: .*{message}", err)


def test_a_folder_is_no_command_file(run, ramp):
    for command in (["simulate", ".", "--out", "log.csv"], ["evaluate", ".", "--task", "rotation"]):
        code, _, err = run(*command)
        assert (code, err) == (
            2,
            "error: . is a folder; name a file in it\n",
        )


def test_an_empty_command_cell_holds_the_value_before_it(run, tmp_path):
    """As docs/data.md says, even where commands are joined linearly."""
    (tmp_path / "gap.csv").write_text(f"{WISHES}\n0,0,300\n1,,\n2,3,\n")
    (tmp_path / "full.csv").write_text(f"{WISHES}\n0,0,300\n1,0,300\n2,3,300\n")
    loads = {}
    for name in ("gap", "full"):
        assert run("simulate", f"{name}.csv", "--no-noise", "--out", "log.csv")[0] == 0
        loads[name] = read_trial(tmp_path / "log.csv").measurements["load"]
    np.testing.assert_array_equal(loads["gap"], loads["full"])


def test_a_trial_begins_settled_at_its_first_row(run, tmp_path):
    """As docs/data.md says: an episode that began at rest needs a first row of 0 V."""
    extensions = {}
    for name, first in (("pulled", ""), ("rest", "-0.01,0,300\n")):
        (tmp_path / f"{name}.csv").write_text(f"{WISHES}\n{first}0,3,300\n1,3,300\n")
        assert run("simulate", f"{name}.csv", "--no-noise", "--out", "log.csv")[0] == 0
        extensions[name] = read_trial(tmp_path / "log.csv").extension
    assert np.abs(extensions["pulled"]).max() < 1e-6
    assert extensions["rest"][-1] > 5e-3


def displacement_log(path, slope=5.2561355, intercept=-0.823263):
    """A log whose extension is the line that table 21 prints for 150 kPa."""
    time = np.arange(PHASE_SAMPLES) / SAMPLE_RATE_HZ
    extension = (intercept + slope * time) * 1e-3
    extension[0] = 0.0
    contraction = 0.03 - extension
    write_trial(Trial(time, {"motor_voltage": 0.0 * time}, {"contraction": contraction}), path)


def test_evaluate_prints_a_trials_rows(run, tmp_path):
    displacement_log(tmp_path / "log.csv")
    code, out, err = run("evaluate", "log.csv", "--task", "displacement")
    assert (code, err) == (0, "")
    assert "Slope (mm/s)" in out and "5.25" in out
    assert "RMSE (mm)" in out


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ("rotation", "the trial has no rotation_deg"),
        ("lifting", "task must be one of displacement, rotation, got 'lifting'"),
    ],
)
def test_what_cannot_be_evaluated_ends_in_one_message(run, tmp_path, task, message):
    displacement_log(tmp_path / "log.csv")
    code, out, err = run("evaluate", "log.csv", "--task", task)
    assert (code, out) == (2, "")
    assert message in err


def test_info_names_models_and_environments(run):
    code, out, _ = run("info")
    assert code == 0
    for name in ("llvmlite", "serres2008", "cascade", "pma_gym/IsokineticRotation-v0", "Rig-v0"):
        assert name in out


def test_info_shows_a_models_parameters(run):
    code, out, _ = run("info", "--model", "serres2008")
    assert code == 0
    assert "97.84" in out and "N/V" in out and "assumption" in out
    code, _, err = run("info", "--model", "nothing")
    assert code == 2
    assert "no model 'nothing'" in err


def test_a_start_loads_no_slow_library():
    slow = {"control", "matplotlib", "scipy", "torch"}
    code = f"import sys, pma_gym.cli; print(sorted({slow} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
