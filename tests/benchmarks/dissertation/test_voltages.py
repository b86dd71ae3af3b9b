"""Voltages for a rig: a file that the simulator takes, and that does what the controller does."""

import csv
import re
import warnings

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.dissertation import FEEDFORWARDS
from benchmarks.runner.rollout import make_environment, rollout
from controllers import CONTROLLERS
from pma_gym.data.files.trial_files import TrialWarning, read_trial
from pma_gym.data.trial import Trial
from pma_gym.plant.plant import Plant


def voltages(out, controller="improved_feedforward", task="displacement", pressure=300, *more):
    words = ["voltages", "--controller", controller, "--task", task]
    return CliRunner().invoke(
        app, [*words, "--pressure", str(pressure), "--out", str(out), *map(str, more)]
    )


def written(path) -> Trial:
    with warnings.catch_warnings():
        # The reference is for people: no trial has it.
        warnings.simplefilter("ignore", TrialWarning)
        return read_trial(path)


@pytest.mark.parametrize("controller", FEEDFORWARDS)
@pytest.mark.parametrize(
    ("task", "quantity"), [("displacement", "extension"), ("rotation", "rotation")]
)
def test_the_file_moves_the_station_as_the_controller_does(controller, task, quantity, tmp_path):
    path = tmp_path / "volts.csv"
    assert voltages(path, controller, task, 400).exit_code == 0
    trial = Plant("station").simulate(written(path), noise=False, interpolation="zoh")
    environment = make_environment(task, "station", 400, noise=False)
    driven = rollout(environment, CONTROLLERS[controller](), seed=0)
    # Every 0.25 s is a row of the file and a sample at 384 Hz; voltages are written to a microvolt.
    moved, position = trial.truth[quantity][1::25], driven.position[::96]
    assert moved == pytest.approx(position, abs=2e-6)


def test_columns_rows_and_reference(tmp_path):
    path = tmp_path / "volts.csv"
    done = voltages(path, "serres_feedforward", "rotation", 350, "--rate", 50)
    assert done.exit_code == 0 and done.stdout == f"753 rows in {path}\n"
    lines = path.read_text().splitlines()
    assert lines[0] == "# serres_feedforward, rotation, 350 kPa, 50 Hz, model station"
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert list(rows[0]) == ["time_s", "motor_voltage_v", "regulator_voltage_v", "reference_deg"]
    # It begins at rest, which is what a station settles at.
    assert (rows[0]["time_s"], float(rows[0]["motor_voltage_v"])) == ("-0.02", 0.0)
    assert {row["regulator_voltage_v"] for row in rows} == {rows[0]["regulator_voltage_v"]}
    by_time = {row["time_s"]: float(row["reference_deg"]) for row in rows}
    assert by_time["5"] == by_time["10"] == 90.0 and by_time["2.5"] == pytest.approx(45.0)


def test_the_regulators_voltage_where_the_regulator_moves(tmp_path):
    path = tmp_path / "volts.csv"
    assert voltages(path, "improved_feedforward", "triangle_low", 150).exit_code == 0
    commands = written(path).commands
    assert np.ptp(commands["motor_voltage"]) == 0.0 < np.ptp(commands["regulator_voltage"])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"controller": "pid"}, r"must be a feed-forward.*'pid' needs feedback at every step"),
        ({"controller": "oracle"}, r"must be a feed-forward.*'oracle' needs feedback"),
        ({"controller": "nobody"}, r"must be a feed-forward.*'nobody' is unknown"),
        ({"task": "dispacement"}, r"task must be one of .*did you mean 'displacement'"),
        ({"pressure": 600}, r"pressure_kpa must be a number in 150-575 kPa .*, got 600"),
        ({"controller": "serres_replay", "pressure": 310}, r"not for 310 kPa; use serres_feed"),
        ({"controller": "serres_replay", "task": "rotation_sine"}, r"not of rotation_sine"),
        ({"controller": "serres_feedforward", "task": "isotonic"}, r"take improved_feedforward"),
    ],
)
def test_what_cannot_be_written_ends_in_one_message(changes, message, tmp_path):
    path = tmp_path / "volts.csv"
    done = voltages(path, **changes)
    assert done.exit_code == 2 and not path.exists() and not done.stdout
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1
    assert re.search(message, done.stderr)


def test_rate_and_folder_are_checked(tmp_path):
    done = voltages(
        tmp_path / "volts.csv", "improved_feedforward", "displacement", 300, "--rate", 0
    )
    assert done.exit_code == 2 and "control_rate_hz must be a number in 1-10000 Hz" in done.stderr
    done = voltages(tmp_path / "nowhere" / "volts.csv")
    assert done.exit_code == 2 and "name a file in a folder that exists" in done.stderr
