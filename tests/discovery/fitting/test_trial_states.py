"""What belongs to each trial: written beside the model, and nothing is lost on the way."""

import subprocess
import sys
import tomllib

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.files.trial_files import write_trial
from pma_gym.data.trial_columns import TrialError
from pma_gym.discovery.fitting.trial_states import dump_states, misfits, read_states
from pma_gym.discovery.preparation.prepared_trials import prepared
from pma_gym.discovery.result.estimates import TrialState
from pma_gym.discovery.workflow import refit
from pma_gym.plant.model import dump_model, parse_model
from tests.discovery.laboratory import STATION, diagnosed, laboratory
from tests.discovery.rig_trials import FROZEN, SLIDE_NOISE, driven_slide


def back(diagnosis, trials, folder):
    """The misfit of what is written and read again."""
    path = folder / "trials.toml"
    path.write_text(dump_states(diagnosis.states), encoding="utf-8")
    model = parse_model(tomllib.loads(dump_model(diagnosis.model)))
    named, _ = prepared(
        [NamedTrial(f"trial {i + 1}", trial) for i, trial in enumerate(trials)], diagnosis.given
    )
    return misfits(named, model, read_states(path))


@pytest.mark.parametrize("case", ["nothing", "parameters", "hysteresis"])
def test_model_and_trials_read_back_give_the_misfit_that_is_printed(case, tmp_path):
    diagnosis = diagnosed(case)
    read = back(diagnosis, laboratory(case)[0], tmp_path)
    for signal, judged in diagnosis.adequacy.items():
        assert read[signal] == pytest.approx(diagnosis.written[signal], rel=0.01)
        assert read[signal] == pytest.approx(judged.fitted * judged.floor, rel=0.01)
    assert set(diagnosis.states["trial 1"].zeros) == {"contraction_mm", "rotation_deg"}


def test_zeros_are_what_the_trials_were_shifted_by(tmp_path):
    trials = []
    for k, trial in enumerate(laboratory("nothing", 3)[0]):
        shifted = trial.measurements["contraction"] + 1e-3 * k
        trials.append(
            trial.__class__(
                trial.time, trial.commands, {**trial.measurements, "contraction": shifted}
            )
        )
    diagnosis = refit(trials, STATION)
    for k in range(3):
        zero = diagnosis.states[f"trial {k + 1}"].zeros["contraction_mm"]
        assert zero == pytest.approx(k, abs=0.02)


def test_a_free_slide_begins_where_its_trials_say():
    trials = driven_slide()
    diagnosis = refit(trials, FROZEN / "driven_slide" / "model.toml")
    generator = np.random.default_rng(31)
    phases, drift = generator.uniform(0, 6, (4, 3)), generator.uniform(-20.0, 20.0, 4)
    speeds = drift + 2 * np.pi * np.cos(phases) @ (np.array([0.35, 0.8, 1.7]) * [18.0, 9.0, 4.0])
    for k, trial in enumerate(trials):
        state = diagnosis.states[f"trial {k + 1}"]
        assert set(state.parameters) == {"start.contraction_mm", "start.velocity_mm_per_s"}
        first = 1e3 * trial.measurements["contraction"][0]
        off = state.parameters["start.contraction_mm"] - first
        assert abs(off) < 3e3 * SLIDE_NOISE
        assert state.parameters["start.velocity_mm_per_s"] == pytest.approx(speeds[k], abs=1.0)
    assert np.ptp(speeds) > 50.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("trials = 1", "must be a table"),
        ('[trials."a.csv"]\nzeros = 1', "must be a table of numbers"),
        ('[trials."a.csv".zeros]\nload = 1', "takes contraction_mm, rotation_deg, load_n, pres"),
        ('[trials."a.csv".zeros]\nload_n = "1"', "must be a finite number, got '1'"),
        ('[trials."a.csv".parameters]\nx = inf', "must be a finite number, got inf"),
        ('[trials."a.csv".parameters]\nx = true', "must be a finite number, got True"),
    ],
)
def test_states_that_cannot_be_used_are_refused(text, words, tmp_path):
    path = tmp_path / "trials.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TrialError, match=words):
        read_states(path)


def test_names_of_files_survive():
    names = ['a "quoted" one.csv', "Stra\u00dfe 1.csv", "tab\there.csv", "bad\udcff.csv"]
    text = dump_states({name: TrialState({"load_n": 1.5}, {}) for name in names})
    tables = tomllib.loads(text)["trials"]
    assert list(tables)[:3] == names[:3] and len(tables) == 4


def test_compare_prints_the_misfit(tmp_path):
    folder = tmp_path / "lab"
    folder.mkdir()
    for k, trial in enumerate(laboratory("nothing", 3)[0]):
        write_trial(trial, folder / f"trial_{k}.csv")
    (tmp_path / "model.toml").write_text(dump_model(STATION), encoding="utf-8")
    diagnosis = refit(laboratory("nothing", 3)[0], STATION)
    named = {f"trial_{k}.csv": diagnosis.states[f"trial {k + 1}"] for k in range(3)}
    (tmp_path / "trials.toml").write_text(dump_states(named), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "pma_gym.cli", "compare", "lab", "--model", "model.toml"]
        + ["--trials", "trials.toml"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        encoding="utf-8",
    )
    assert done.returncode == 0, done.stderr
    assert f"{diagnosis.written['load_n']:.3f}" in done.stdout and "kPa" in done.stdout
    assert done.stderr == ""
