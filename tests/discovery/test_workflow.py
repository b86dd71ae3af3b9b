"""From trials to answer: the same bytes, in every circumstance that a laboratory offers."""

import json
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import pma_gym.envs  # noqa: F401
from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import TrialError
from pma_gym.discovery import workflow
from pma_gym.discovery.selection.forward_selection import Selection
from pma_gym.discovery.workflow import diagnose, refit
from pma_gym.plant.model import dump_model, load_model
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import STATION, diagnosed, laboratory, measured, only

EVERY = ("contraction", "rotation", "load", "pressure")


@pytest.fixture(scope="module")
def amended(tmp_path_factory):
    path = tmp_path_factory.mktemp("amended") / "model.toml"
    path.write_text(dump_model(diagnosed("hysteresis").model), encoding="utf-8")
    return path


def test_the_seed_changes_chance_alone():
    trials = laboratory("parameters")[0]
    one, other = (diagnose(trials, STATION, seed=seed, propose=False) for seed in (0, 1))
    assert one.text() == diagnosed("parameters").text()
    assert one.verdict == other.verdict
    assert one.parameters == other.parameters
    drawn = [[each.p_value for each in diagnosis.candidates] for diagnosis in (one, other)]
    assert drawn[0] != drawn[1]


def test_the_text_is_json_with_all_parts():
    document = json.loads(diagnosed("hysteresis").text())
    assert document["schema"] == 1
    assert {"verdict", "where", "effects", "parameters", "gap", "candidates"} <= set(document)
    assert document["effects"][0]["name"] == "hysteresis"
    assert set(document["gap"]) == {"contraction_mm", "rotation_deg", "load_n", "pressure_kpa"}


def test_the_amended_model_drives_an_environment(amended):
    env = gym.make("pma_gym/IsokineticDisplacement-v0", model=str(amended))
    observation, _ = env.reset(seed=0)
    assert np.all(np.isfinite(observation))
    observation, *_ = env.step(env.action_space.sample())
    assert np.all(np.isfinite(observation))
    env.close()


def test_the_amended_model_is_a_plant_that_repeats_the_trials(amended):
    trials, _ = laboratory("hysteresis")
    plant, given = Plant(load_model(amended)), Plant(STATION)
    for trial in trials:
        read = trial.measurements["load"]
        load, before = (
            _rms(each.simulate(trial, noise=False).measurements["load"] - read)
            for each in (plant, given)
        )
        assert load < 0.8
        assert before > 3 * load


def _rms(gap):
    return float(np.sqrt(np.mean(gap**2)))


def test_other_trials_agree_with_the_amended_model(amended):
    truth = laboratory("hysteresis")[1]
    diagnosis = diagnose(measured(truth, 3, seed=8), amended, propose=False)
    assert diagnosis.verdict in ("agrees", "parameters")
    assert not diagnosis.effects


def test_one_trial_works_and_says_so():
    diagnosis = diagnosed("nothing", 1)
    assert diagnosis.verdict in ("agrees", "undecidable")
    assert any("one trial" in warning for warning in diagnosis.warnings)
    assert not any(gap.held_out for gap in diagnosis.gap.values())


@pytest.mark.campaign
@pytest.mark.parametrize("kept", [("contraction",), EVERY[1:]])
def test_some_sensors_are_enough(kept):
    trials = [only(trial, *kept) for trial in laboratory("hysteresis")[0]]
    diagnosis = diagnose(trials, STATION, propose=False)
    assert [effect.name for effect in diagnosis.effects] == ["hysteresis"]


def test_what_was_not_measured_is_not_judged():
    diagnosis = refit([only(trial, *EVERY[1:]) for trial in laboratory("hysteresis")[0]], STATION)
    assert {signal.rpartition("_")[0] for signal in diagnosis.gap} == set(EVERY[1:])
    assert set(diagnosis.floors) == set(diagnosis.gap)


def test_different_sensors_and_gaps_do_no_harm():
    """Each trial lacks a sensor, not all the same, and has no reading here and there."""
    generator = np.random.default_rng(2)
    trials = []
    for k, trial in enumerate(laboratory("hysteresis")[0]):
        rows = {
            name: np.where(generator.random(len(row)) < 0.1, np.nan, row)
            for name, row in trial.measurements.items()
        }
        rows["load"][40:90] = np.nan
        trials.append(only(Trial(trial.time, trial.commands, rows), *EVERY[k % 2 : 3 + k % 2]))
    diagnosis = diagnose(trials, STATION, propose=False)
    assert [effect.name for effect in diagnosis.effects] == ["hysteresis"]
    force = diagnosis.effects[0].parameters["force_n"]
    assert force.low is not None and force.high is not None
    assert force.value == pytest.approx(6.0, abs=3 * (force.high - force.low) / 3.92)
    assert np.isfinite([gap.after for gap in diagnosis.gap.values()]).all()


def test_names_of_a_data_set_are_kept():
    trials = laboratory("nothing", 2)[0]
    named = tuple(NamedTrial(f"run_{k}.csv", trial) for k, trial in enumerate(trials))
    diagnosis = refit(Dataset("", None, named), STATION)
    assert [trial.name for trial in diagnosis.trials] == ["run_0.csv", "run_1.csv"]


def test_a_refit_looks_for_nothing():
    diagnosis = refit(laboratory("hysteresis")[0], STATION)
    assert diagnosis.verdict == "unknown"
    assert diagnosis.candidates == () and diagnosis.effects == ()
    assert diagnosis.parameters["drive.gain_n_per_v"].significant


def test_a_refit_that_fits_its_own_readings_worse_is_discarded(monkeypatch):
    worse = STATION.replace({"drive.gain_n_per_v": 99.0})
    own = workflow._Work._refitted

    def caught(self, problem):
        fit = own(self, problem)
        moved = np.array(
            [
                99.0 if path == "drive.gain_n_per_v" else value
                for path, value in zip(fit.paths, fit.values, strict=True)
            ]
        )
        return replace(fit, model=worse, values=moved)

    monkeypatch.setattr(workflow._Work, "_refitted", caught)
    monkeypatch.setattr(
        workflow, "_nothing", lambda problem, fit: Selection((), (), fit, problem, fit)
    )
    diagnosis = refit(laboratory("nothing")[0], STATION)
    assert diagnosis.model == STATION and diagnosis.parameters == {}
    assert any("a refit was discarded: it raises" in words for words in diagnosis.warnings)
    assert diagnosis.verdict == "agrees"


def test_progress_is_told():
    messages = []
    diagnose(
        laboratory("parameters")[0],
        STATION,
        progress=lambda *each: messages.append(each),
        propose=False,
    )
    steps = [step for step, _, _ in messages]
    assert steps[0] == "refitting parameters"
    assert steps[-1] == "putting the answer together"
    assert all(0 <= done <= total for _, done, total in messages)


def test_nothing_cannot_be_diagnosed():
    with pytest.raises(TrialError, match="at least one trial"):
        diagnose([], STATION)


def test_too_few_readings_are_refused_with_their_number():
    trial = laboratory("nothing", 1)[0][0]
    few = Trial(
        trial.time[:8],
        {name: row[:8] for name, row in trial.commands.items()},
        {"load": trial.measurements["load"][:8]},
    )
    with pytest.raises(TrialError, match="8 readings for"):
        diagnose([few], STATION)
