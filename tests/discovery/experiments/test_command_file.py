"""next.csv is a file that the lab could have written: its names, its units, from rest."""

import shutil

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.files.trial_files import read_trial
from pma_gym.data.trial import Trial
from pma_gym.discovery.experiments.command_file import from_rest, proposed_file
from pma_gym.plant.plant import Plant
from tests.discovery.grey_box import test_free_rigs
from tests.discovery.preparation.data_checks.logs import GIVEN, log, write

TOML = """[columns]
"Zeit [ms]" = { name = "time_s", factor = 0.001 }
"Druck soll [bar abs]" = { name = "pressure_command_kpa", factor = 100, offset = -101.325 }
"""


def lab(folder):
    """A lab that commands bar absolute, and writes milliseconds."""
    columns = log(2.0, 300.0, 1, seconds=2.0)
    renamed = {
        {"time_s": "Zeit [ms]", "pressure_command_kpa": "Druck soll [bar abs]"}.get(k, k): v
        for k, v in columns.items()
    }
    renamed["Zeit [ms]"] = 1e3 * renamed["Zeit [ms]"]
    renamed["Druck soll [bar abs]"] = (renamed["Druck soll [bar abs]"] + 101.325) / 100
    return read_dataset(write(folder, [renamed], TOML))


def experiment():
    """One second of pulls from 2 V at 250 kPa, as a diagnosis proposes it: in volts."""
    time = np.arange(129) / 128.0
    volts = Plant(GIVEN).regulator_voltage(250e3)
    return Trial(time, {"motor_voltage": 2.0 + 1.0 * time, "regulator_voltage": 0.0 * time + volts})


def test_the_labs_own_names_and_units(tmp_path):
    dataset = lab(tmp_path / "lab")
    path = tmp_path / "next.csv"
    path.write_bytes(proposed_file(experiment(), dataset, GIVEN))
    assert path.read_text().splitlines()[0] == "Zeit [ms],motor_voltage_v,Druck soll [bar abs]"
    first = path.read_text().splitlines()[1].split(",")
    assert float(first[2]) == pytest.approx(3.51325, rel=1e-6)
    # Measured under another name it is a trial of the same data set.
    shutil.copy(path, tmp_path / "as_read.csv")
    read = read_trial(tmp_path / "as_read.csv", dataset.columns)
    assert read.commands["pressure_command"] == pytest.approx(250e3, rel=1e-7)
    assert read.commands["motor_voltage"][-129:] == pytest.approx(2.0 + np.arange(129) / 128.0)


def test_it_begins_at_rest_and_leads_there(tmp_path):
    path = tmp_path / "next.csv"
    path.write_bytes(proposed_file(experiment(), lab(tmp_path / "lab"), GIVEN))
    read = read_trial(path, lab(tmp_path / "lab").columns)
    volts = read.commands["motor_voltage"]
    assert read.time[0] == 0.0
    assert np.all(volts[read.time < 0.99] == 0.0)
    assert np.max(np.abs(np.diff(volts[:-129]))) < 0.02
    simulated = Plant(GIVEN).simulate(read, noise=False)
    settled = Plant(GIVEN).simulate(experiment(), noise=False)
    # The experiment begins as it was promised: settled at its first commands.
    away = simulated.truth["contraction"][-129:] - settled.truth["contraction"]
    # But for what friction keeps of the way: less than it holds at rest anyway.
    assert np.max(np.abs(away)) < 1e-4


def test_a_lab_of_volts_gets_volts(tmp_path):
    columns = log(2.0, 300.0, 1, seconds=1.0)
    volts = Plant(GIVEN).regulator_voltage(300e3)
    written = {
        ("regulator_voltage_v" if k == "pressure_command_kpa" else k): (
            0.0 * v + volts if k == "pressure_command_kpa" else v
        )
        for k, v in columns.items()
    }
    dataset = read_dataset(write(tmp_path / "lab", [written]))
    text = proposed_file(experiment(), dataset, GIVEN).decode()
    assert text.splitlines()[0] == "time_s,motor_voltage_v,regulator_voltage_v"


def test_a_slide_has_no_rest_without_its_command():
    trial = experiment()
    assert from_rest(trial, test_free_rigs.model("slide")) is trial
