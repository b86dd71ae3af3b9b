"""`pma-gym diagnose` end to end, on logs simulated with an effect that the model lacks."""

import json
import subprocess
import sys

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.files.trial_files import write_trial
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.data_checks import check_dataset
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant


def pull(period, pressure):
    """Whole waves for some 4 s, then a rest, in which the sensors show their noise."""
    time = np.arange(0.0, 5.5, 1 / 64)
    waves = np.minimum(time, round(4.0 / period) * period)
    volts = 2.5 * (1.0 - np.cos(2 * np.pi * waves / period))
    return Trial(time, {"motor_voltage": volts, "pressure_command": np.full(time.size, pressure)})


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Two logs of a station with 25 N of dry friction."""
    folder = tmp_path_factory.mktemp("data") / "lab"
    folder.mkdir()
    friction = {"coulomb_friction.static_n": 25.0, "coulomb_friction.dynamic_n": 20.0}
    rig = Plant(load_model("serres2008").replace(friction))
    for seed, (period, pressure) in enumerate(((1.3, 200e3), (2.0, 450e3))):
        trial = rig.simulate(pull(period, pressure), seed=seed)
        write_trial(trial, folder / f"pull_{period:g}s_{pressure / 1e3:g}kPa.csv")
    return folder


def command(*arguments, cwd):
    return subprocess.run(
        [sys.executable, "-m", "pma_gym.cli", *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
    )


def test_a_log_with_friction_is_diagnosed_alike_by_the_command_and_in_another_process(
    lab, tmp_path
):
    done = command("diagnose", lab, "--model", "serres2008", "--out", "one", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "one" / "diagnosis.json").read_text()
    given = load_model("serres2008")
    assert diagnose(check_dataset(read_dataset(lab), given), given).text() == text
    document = json.loads(text)
    # serres2008 has 1.5 N of this friction: its size is a parameter, and the answer is its value.
    assert document["verdict"] == "parameters"
    assert document["parameters"]["coulomb_friction.dynamic_n"]["to"] == pytest.approx(
        20.0, rel=0.05
    )
    assert all(gap["after"] < 1.2 * gap["floor"] for gap in document["gap"].values())
    assert load_model(tmp_path / "one" / "model.toml").plant == "station"
    assert "<html" in (tmp_path / "one" / "report.html").read_text()


def test_a_fit_finds_the_friction(lab, tmp_path):
    done = command("fit", lab, "--model", "serres2008", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads((tmp_path / "lab-fit" / "fit.json").read_text())
    dynamic = document["parameters"]["coulomb_friction.dynamic_n"]
    assert dynamic["low"] <= 20.0 <= dynamic["high"]
