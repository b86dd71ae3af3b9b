"""`pma-gym convert`: a lab's files become a data set whose draft reads as the right trials."""

import json
import tomllib

import numpy as np
import pytest
from scipy.io import savemat

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.plant.model import load_model
from tests.discovery.preparation.data_checks.logs import logs, write

NAMES = {
    "time_s": ("Zeit [ms]", 1e3),
    "motor_voltage_v": ("U_Motor", 1.0),
    "pressure_command_kpa": ("Druck_soll [bar]", 1e-2),
    "contraction_mm": ("Weg [cm]", 0.1),
    "rotation_deg": ("Winkel", 1.0),
    "load_n": ("Kraft_kN", 1e-3),
    "pressure_kpa": ("Druck", 1e-2),
}


def lab(folder):
    renamed = []
    for each in logs(seconds=3.0):
        columns = {NAMES[name][0]: NAMES[name][1] * values for name, values in each.items()}
        renamed.append(columns)
    return write(folder, renamed)


def test_a_draft_reads_the_labs_files_as_they_were_meant(tmp_path, run):
    folder = lab(tmp_path / "lab")
    code, out, err = run("convert", folder, "--model", "serres2008")
    assert (code, err) == (0, "")
    assert "Druck_soll [bar]" in out
    assert "values up to" in out
    right = read_dataset(write(tmp_path / "right", logs(seconds=3.0)))
    drafted = read_dataset(folder)
    assert drafted.model == "serres2008"
    for one, other in zip(drafted.trials, right.trials, strict=True):
        for group in ("commands", "measurements"):
            for name, values in getattr(other.trial, group).items():
                assert getattr(one.trial, group)[name] == pytest.approx(values, rel=1e-6, abs=1e-6)
        assert np.allclose(one.trial.time, other.trial.time)


def test_an_older_description_is_kept_unless_forced(tmp_path, run):
    folder = lab(tmp_path / "lab")
    (folder / "dataset.toml").write_text('title = "mine"\n')
    code, _, err = run("convert", folder)
    assert code == 2
    assert "--force replaces it" in err
    assert (folder / "dataset.toml").read_text() == 'title = "mine"\n'
    assert run("convert", folder, "--force", "--model", "serres2008")[0] == 0
    assert tomllib.loads((folder / "dataset.toml").read_text())["title"] == "lab"


def test_what_the_checks_propose_stands_in_comments(tmp_path, run):
    turned = [{**e, "contraction_mm": -e["contraction_mm"]} for e in logs(seconds=3.0)]
    folder = write(tmp_path / "lab", turned)
    code, _, err = run("convert", folder, "--model", "serres2008")
    assert code == 0
    line = '"contraction_mm" = { name = "contraction_mm", factor = -1 }'
    assert line in err
    assert line in (folder / "dataset.toml").read_text()


def test_names_are_data(tmp_path, run):
    """Quotes, backslashes and control characters of a header neither end a text nor a comment."""
    odd = 'Weg "x" \\ \x1b[2J'
    folder = write(tmp_path / "lab", [{**each, odd: each["load_n"]} for each in logs(seconds=2.0)])
    code, out, _ = run("convert", folder, "--model", "serres2008")
    assert code == 0
    text = (folder / "dataset.toml").read_text()
    tomllib.loads(text)
    assert "\x1b" not in text + out


def test_json_has_what_every_column_is_taken_for(tmp_path, run):
    folder = lab(tmp_path / "lab")
    code, out, _ = run("convert", folder, "--model", "serres2008", "--json")
    document = json.loads(out)
    taken = {each["name"]: each["taken_for"] for each in document["columns"]}
    assert code == 0 and taken["Kraft_kN"] == "load_n" and document["tables"] > 1
    code, out, _ = run("compare", folder, "--json")
    misfit = json.loads(out)["misfit_rms"]
    assert code == 0 and set(misfit) >= {"contraction_mm", "load_n"}
    assert all(size > 0.0 for size in misfit.values())


JOINT = """schema = 1
name = "pendulum"
title = "A pendulum"
plant = "joint"
[torque_drive]
gain = 1.0
[joint_weight]
moment_n_m = 0.2
offset_deg = 0.0
[joint_damping]
coefficient_n_m_s = 0.02
[inertia]
inertia_kg_m2 = 0.0049
[joint_start]
angle_deg = 0.0
spin_deg_per_s = 0.0
[encoder]
bandwidth_hz = 2000
noise_deg = 0.02
"""
TIME = np.arange(0.0, 4.0, 0.01)
SWING = np.stack([TIME, 20.0 * np.sin(TIME), 0.2 * np.cos(TIME), 0.35 * np.cos(TIME)], axis=1)


def test_a_draft_is_of_the_models_rig_and_reads_from_any_directory(tmp_path, run, monkeypatch):
    (tmp_path / "lab").mkdir()
    (tmp_path / "joint.toml").write_text(JOINT)
    header = "time,position,torque [mNm],velocity"
    np.savetxt(tmp_path / "lab" / "a.csv", SWING, delimiter=",", header=header, comments="")
    monkeypatch.chdir(tmp_path)
    code, _, err = run("convert", "lab", "--model", "joint.toml")
    assert (code, err) == (0, "")
    assert tomllib.loads((tmp_path / "lab/dataset.toml").read_text())["model"] == "../joint.toml"
    moved = tmp_path.rename(tmp_path.with_name("moved"))
    monkeypatch.chdir(moved.parent)
    dataset = read_dataset(moved / "lab")
    assert load_model(dataset.model).name == "pendulum"
    trial = dataset.trials[0].trial
    assert trial.measurements["angle"] == pytest.approx(np.radians(SWING[:, 1]))
    assert trial.commands["torque_command"] == pytest.approx(1e-3 * SWING[:, 2])
    assert trial.measurements["speed"] == pytest.approx(SWING[:, 3])


@pytest.mark.parametrize("name", ["a.csv", "a.mat"])
def test_a_matrix_without_names_is_shown_by_what_its_columns_hold(tmp_path, run, name):
    if name == "a.csv":
        np.savetxt(tmp_path / name, SWING, delimiter=",")
    else:
        savemat(tmp_path / name, {"data": SWING})
    code, _, err = run("convert", tmp_path)
    assert code == 2
    assert "column 1 holds 0 to 3.99, column 2 holds -15 to 20, column 3 holds" in err
