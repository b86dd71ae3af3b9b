"""From trials to answer: each verdict with what it must bring along, the same bytes everywhere."""

import json
import subprocess
import sys
from dataclasses import replace
from functools import cache

import gymnasium as gym
import numpy as np
import pytest

import pma_gym.envs  # noqa: F401
from pma_gym.data.datasets.dataset import Dataset, NamedTrial, read_dataset
from pma_gym.data.files.trial_files import write_trial
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import TrialError
from pma_gym.discovery import workflow
from pma_gym.discovery.fitting.free_parameters import at_limit
from pma_gym.discovery.preparation.data_checks import check_dataset
from pma_gym.discovery.selection.forward_selection import Selection
from pma_gym.discovery.workflow import diagnose, refit
from pma_gym.plant.model import dump_model, load_model
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import (
    LEVELS,
    OFF,
    STATION,
    commanded,
    diagnosed,
    laboratory,
    measured,
    only,
)

EVERY = ("contraction", "rotation", "load", "pressure")
HIDDEN = {"force_n": 6.0, "distance_mm": 1.0}


@cache
def standing():
    """The diagnosis of trials whose commands never change, with what it proposes."""
    plant = Plant(STATION.replace(OFF))
    simulated = []
    for k, trial in enumerate(commanded(2)):
        still = {name: np.full(len(trial), row[0]) for name, row in trial.commands.items()}
        simulated.append(plant.simulate(Trial(trial.time, still), seed=k))
    return diagnose(simulated, STATION)


@pytest.fixture(scope="module")
def amended(tmp_path_factory):
    path = tmp_path_factory.mktemp("amended") / "model.toml"
    path.write_text(dump_model(diagnosed("hysteresis").model), encoding="utf-8")
    return path


# -- verdicts --------------------------------------------------------------------------------------


def test_the_true_model_agrees():
    diagnosis = diagnosed("nothing")
    assert diagnosis.verdict == "agrees" and "agrees" in diagnosis.sentence
    assert diagnosis.effects == () and diagnosis.law is None
    assert diagnosis.model == diagnosis.given
    assert set(diagnosis.adequacy) == set(diagnosis.gap)
    for judgement in diagnosis.adequacy.values():
        assert judgement.fault is None and judgement.misfit == pytest.approx(1.0, abs=0.3)
    assert diagnosis.document()["adequacy"]["load_n"]["source"] == "rest segments"
    floors = [floor.value for floor in diagnosis.floors.values()]
    factors = (1e-3, np.pi / 180.0, 1.0, 1e3)
    assert np.multiply(floors, factors) == pytest.approx(LEVELS, rel=0.25)


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_the_true_model_agrees_whatever_the_noise(seed):
    diagnosis = diagnose(measured(STATION, 4, rate=32.0, seed=seed), STATION, propose=False)
    assert diagnosis.verdict == "agrees"
    assert min(each.p_value for each in diagnosis.candidates) > 0.01
    assert not diagnosis.where or min(place.p_value for place in diagnosis.where) > 1e-4


def test_parameters_that_are_off_are_named():
    # Of three trials, one of each kind, two do not hold the parameters for the third.
    few, diagnosis = diagnosed("parameters"), diagnosed("parameters", 6)
    assert few.verdict == "undecidable"
    assert "do not determine the parameters" in few.sentence
    significant = {path for path, moved in few.parameters.items() if moved.significant}
    assert set(OFF) <= significant and len(significant) <= len(OFF) + 1
    assert diagnosis.verdict == "parameters" and diagnosis.effects == ()
    for path, truth in OFF.items():
        moved = diagnosis.parameters[path]
        effect, _, file_key = path.partition(".")
        assert moved.significant and path in diagnosis.sentence
        assert moved.start == pytest.approx(STATION.values_in_files(effect)[file_key])
        assert abs(moved.now.value - truth) < moved.now.high - moved.now.low
    gain = diagnosis.model.values_in_files("drive")["gain_n_per_v"]
    assert gain == pytest.approx(101.0, rel=2e-3)


def test_hysteresis_is_named_with_its_size():
    diagnosis = diagnosed("hysteresis")
    (effect,) = diagnosis.effects
    assert diagnosis.verdict == "effect" and effect.name == "hysteresis"
    assert effect.p_value <= 0.005 and "hysteresis" in diagnosis.sentence
    for name, truth in HIDDEN.items():
        estimate, note = effect.parameters[name], diagnosis.model.notes[f"hysteresis.{name}"]
        assert 0.0 <= estimate.low < estimate.value < estimate.high
        assert abs(estimate.value - truth) < 3.0 * (estimate.high - estimate.low) / 3.92
        assert (note.low, note.high) == pytest.approx((estimate.low, estimate.high))
        at = diagnosis.covariance.parameters.index(f"hysteresis.{name}")
        width = 3.92 * diagnosis.covariance.deviations[at]
        assert width == pytest.approx(estimate.high - estimate.low)
    correlation = np.array(diagnosis.covariance.correlation)
    assert np.linalg.eigvalsh(correlation).min() > 0.0 and np.allclose(np.diag(correlation), 1.0)
    assert set(diagnosis.parameters) < set(diagnosis.covariance.parameters)
    first, *_ = diagnosis.candidates
    assert (first.name, first.why) == ("hysteresis", "added to the model")
    assert first.held_out_gain > 0.0
    names = {each.name for each in diagnosis.candidates}
    assert len(names) == len(diagnosis.candidates) > 25
    assert all(each.why for each in diagnosis.candidates)
    assert set(diagnosis.not_detectable) <= names


def test_an_effect_closes_the_gap_on_trials_it_has_not_seen():
    diagnosis = diagnosed("hysteresis")
    assert all(gap.held_out for gap in diagnosis.gap.values())
    for signal in ("contraction_mm", "rotation_deg"):
        assert diagnosis.gap[signal].after < 0.5 * diagnosis.gap[signal].parameters
    load = diagnosis.gap["load_n"]
    assert load.before > 5 * load.after
    assert load.after == pytest.approx(load.floor, rel=0.1)
    for record, trial in zip(diagnosis.trials, laboratory("hysteresis")[0], strict=True):
        shape = (len(trial), 4)
        assert record.measured.shape == record.before.shape == record.after.shape == shape
        assert np.array_equal(record.measured[:, 2], trial.measurements["load"])


def test_the_text_is_json_with_all_parts():
    document = json.loads(diagnosed("hysteresis").text())
    assert document["schema"] == 1 and document["approximate"] is None
    assert {"verdict", "where", "effects", "parameters", "gap", "candidates"} <= set(document)
    assert document["effects"][0]["name"] == "hysteresis"
    assert set(document["gap"]) == {"contraction_mm", "rotation_deg", "load_n", "pressure_kpa"}


def test_what_never_moves_decides_nothing():
    diagnosis = standing()
    proposed = diagnosis.next_experiment
    assert diagnosis.verdict == "undecidable" and proposed is not None
    assert proposed.excitation in diagnosis.sentence and proposed.separates
    assert any(np.ptp(row) > 0.0 for row in proposed.trial.commands.values())
    assert len(diagnosis.not_detectable) > 10
    assert "damping.contracting_n_s_per_mm" in diagnosis.not_identifiable
    assert all(diagnosis.not_identifiable.values())


def test_one_trial_works_and_says_so():
    diagnosis = diagnosed("nothing", 1)
    assert diagnosis.verdict in ("agrees", "undecidable")
    assert any("one trial" in warning for warning in diagnosis.warnings)
    assert not any(each.held_out for each in (*diagnosis.gap.values(), *diagnosis.trials))


@pytest.mark.campaign
def test_two_effects_are_both_named():
    effects = {each.name: each.parameters for each in diagnosed("pair").effects}
    assert set(effects) == {"hysteresis", "regulator_delay"}
    assert effects["regulator_delay"]["delay_ms"].value == pytest.approx(20.0, abs=2.0)


def test_a_limit_that_is_never_reached_has_its_own_size():
    truth = STATION.with_effects({"regulator_rate_limit": {"limit_kpa_per_s": 600.0}})
    diagnosis = diagnose(measured(truth, 3, kinds=(1,)), STATION, propose=False)
    (effect,) = diagnosis.effects
    limit = effect.parameters["limit_kpa_per_s"]
    assert effect.name == "regulator_rate_limit" and not diagnosis.unfitted
    assert limit.value == pytest.approx(600.0, rel=0.02) and limit.limit == ""


def test_a_boundless_range_has_a_lower_end_only_where_it_begins():
    """A value far above the lower end is not there because the upper end is farther."""
    assert at_limit(638.0, 10.0, 1e9) == ""
    assert at_limit(10.0, 10.0, 1e9) == "lower"
    assert at_limit(1e9, 10.0, 1e9) == "upper"


def test_an_effect_that_one_trial_of_three_shows_is_named():
    """The other two hold neither it nor the parameters: of them alone the third is a guess."""
    plant = Plant(laboratory("hysteresis")[1])
    trials = laboratory("hysteresis")[0][1:2]
    for seed, asked in enumerate(commanded(2)):
        still = {name: np.full(len(asked), row[0]) for name, row in asked.commands.items()}
        trials.append(plant.simulate(Trial(asked.time, still), seed=seed))
    diagnosis = diagnose(trials, STATION, propose=False)
    (effect,) = diagnosis.effects
    assert (diagnosis.verdict, effect.name) == ("effect", "hysteresis"), diagnosis.sentence
    # One trial, whose start is free, tells the force less well than many.
    assert effect.parameters["force_n"].value == pytest.approx(6.0, rel=0.2)


@pytest.mark.campaign
def test_intervals_cover_the_truth():
    """Of all the parameters that moved, over several data sets, some 95 %."""
    covered = []
    for seed in (11, 12, 13, 14):
        trials = measured(STATION.replace(OFF), 4, rate=32.0, seed=seed)
        moved = diagnose(trials, STATION, propose=False).parameters
        covered += [
            moved[path].now.low <= true <= moved[path].now.high for path, true in OFF.items()
        ]
    assert sum(covered) >= 6


@pytest.mark.campaign
@pytest.mark.parametrize("kept", [("contraction",), EVERY[1:]])
def test_some_sensors_are_enough(kept):
    trials = [only(trial, *kept) for trial in laboratory("hysteresis")[0]]
    diagnosis = diagnose(trials, STATION, propose=False)
    assert [effect.name for effect in diagnosis.effects] == ["hysteresis"]


@pytest.mark.campaign
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
    (effect,) = diagnosis.effects
    force = effect.parameters["force_n"]
    assert effect.name == "hysteresis" and force.low is not None and force.high is not None
    assert force.value == pytest.approx(6.0, abs=3 * (force.high - force.low) / 3.92)
    assert np.isfinite([gap.after for gap in diagnosis.gap.values()]).all()


# -- the amended model -----------------------------------------------------------------------------


def test_the_amended_model_drives_an_environment(amended):
    env = gym.make("pma_gym/IsokineticDisplacement-v0", model=str(amended))
    observations = [env.reset(seed=0)[0], env.step(env.action_space.sample())[0]]
    assert np.all(np.isfinite(observations))
    env.close()


def test_the_amended_model_is_a_plant_that_repeats_the_trials(amended):
    plants = Plant(load_model(amended)), Plant(STATION)
    for trial in laboratory("hysteresis")[0]:
        read = trial.measurements["load"]
        seen = [each.simulate(trial, noise=False).measurements["load"] for each in plants]
        load, before = (float(np.sqrt(np.mean((each - read) ** 2))) for each in seen)
        assert load < 0.8 and before > 3 * load


@pytest.mark.campaign
def test_other_trials_agree_with_the_amended_model(amended):
    truth = laboratory("hysteresis")[1]
    diagnosis = diagnose(measured(truth, 3, seed=8), amended, propose=False)
    assert diagnosis.verdict in ("agrees", "parameters") and not diagnosis.effects


def test_a_second_diagnosis_changes_nothing_beyond_the_first_ones_intervals(amended):
    first, model = diagnosed("hysteresis"), load_model(amended)
    second = diagnose(laboratory("hysteresis")[0], model, propose=False)
    assert second.verdict == "agrees", second.sentence
    assert second.effects == () and second.model == model
    for path, moved in second.parameters.items():
        note = first.model.notes[path]
        assert note.low <= moved.now.value <= note.high, path
    for signal, gap in second.gap.items():
        assert gap.after == pytest.approx(first.written[signal], rel=0.01), signal


# -- refits ----------------------------------------------------------------------------------------


def test_a_refit_looks_for_nothing_and_judges_what_was_measured():
    """The names of a data set are kept."""
    trials = [only(trial, *EVERY[1:]) for trial in laboratory("hysteresis")[0]]
    named = tuple(NamedTrial(f"run_{k}.csv", trial) for k, trial in enumerate(trials))
    diagnosis = refit(Dataset("", None, named), STATION)
    assert diagnosis.verdict == "unknown"
    assert diagnosis.candidates == () and diagnosis.effects == ()
    assert diagnosis.parameters["drive.gain_n_per_v"].significant
    assert {signal.rpartition("_")[0] for signal in diagnosis.gap} == set(EVERY[1:])
    assert set(diagnosis.floors) == set(diagnosis.gap)
    assert [trial.name for trial in diagnosis.trials] == [each.name for each in named]


def test_the_reader_is_told_what_went_beyond_what_is_assumed():
    gain = 2.0 * STATION.values_in_files("drive")["gain_n_per_v"]
    strong = STATION.replace({"drive.gain_n_per_v": gain})
    trials = measured(strong, 2, rate=32.0, kinds=(0, 0), kpa=(400.0, 520.0))
    diagnosis = refit(trials, STATION)
    assert diagnosis.parameters["drive.gain_n_per_v"].now.value == pytest.approx(gain, rel=0.01)
    (said,) = (words for words in diagnosis.warnings if words.startswith("drive.gain_n_per_v"))
    assert "beyond what is assumed beforehand (39.1 to 157 N/V)" in said
    assert "widened 2 times" in said


def test_a_refit_that_fits_its_own_readings_worse_is_discarded(monkeypatch):
    worse = STATION.replace({"drive.gain_n_per_v": 99.0})
    own = workflow._Work._refitted

    def caught(self, problem):
        fit = own(self, problem)
        moved = np.where(np.array(fit.paths) == "drive.gain_n_per_v", 99.0, fit.values)
        return replace(fit, model=worse, values=moved)

    monkeypatch.setattr(workflow._Work, "_refitted", caught)
    monkeypatch.setattr(
        workflow, "_nothing", lambda problem, fit: Selection((), (), fit, problem, fit)
    )
    diagnosis = refit(laboratory("nothing")[0], STATION)
    assert diagnosis.model == STATION and diagnosis.parameters == {}
    assert any("a refit was discarded: it raises" in words for words in diagnosis.warnings)
    assert diagnosis.verdict == "agrees"


# -- circumstances ---------------------------------------------------------------------------------


def test_the_seed_changes_chance_alone_and_progress_is_said():
    messages, one = [], diagnosed("parameters")
    other = diagnose(
        laboratory("parameters")[0],
        STATION,
        seed=1,
        progress=lambda *each: messages.append(each),
        propose=False,
    )
    assert (one.verdict, one.parameters) == (other.verdict, other.parameters)
    drawn = [[each.p_value for each in diagnosis.candidates] for diagnosis in (one, other)]
    assert drawn[0] != drawn[1]
    steps = [step for step, _, _ in messages]
    assert (steps[0], steps[-1]) == ("refitting parameters", "putting the answer together")
    assert all(0 <= done <= total for _, done, total in messages)


def test_what_cannot_be_diagnosed_is_refused():
    with pytest.raises(TrialError, match="at least one trial"):
        diagnose([], STATION)
    trial = laboratory("nothing", 1)[0][0]
    few = Trial(
        trial.time[:8],
        {name: row[:8] for name, row in trial.commands.items()},
        {"load": trial.measurements["load"][:8]},
    )
    with pytest.raises(TrialError, match="8 readings for"):
        diagnose([few], STATION)


def pull(period, pressure):
    """Whole waves for some 4 s, then a rest, in which the sensors show their noise."""
    time = np.arange(0.0, 5.5, 1 / 64)
    waves = np.minimum(time, round(4.0 / period) * period)
    volts = 2.5 * (1.0 - np.cos(2 * np.pi * waves / period))
    return Trial(time, {"motor_voltage": volts, "pressure_command": np.full(time.size, pressure)})


@pytest.fixture(
    scope="module", params=["gain", pytest.param("friction", marks=pytest.mark.campaign)]
)
def lab(request, tmp_path_factory):
    """A folder of logs with the model that the lab believes; the path and value that are off."""
    folder = tmp_path_factory.mktemp("data") / "lab"
    folder.mkdir()
    # serres2008 has 1.5 N of dry friction: its size is a parameter, and the answer is its value.
    friction = {"coulomb_friction.static_n": 25.0, "coulomb_friction.dynamic_n": 20.0}
    given, off = {
        "gain": (STATION, {"drive.gain_n_per_v": 101.0}),
        "friction": (load_model("serres2008"), friction),
    }[request.param]
    (folder / "model.toml").write_text(dump_model(given), encoding="utf-8")
    (folder / "dataset.toml").write_text('model = "model.toml"\n')
    for seed, asked in enumerate((pull(1.3, 200e3), pull(2.0, 450e3))):
        trial = Plant(given.replace(off)).simulate(asked, seed=seed)
        write_trial(trial, folder / f"pull_{seed}.csv")
    return folder, list(off.items())[-1]


def command(*arguments, cwd):
    done = subprocess.run(
        [sys.executable, "-m", "pma_gym.cli", *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_the_command_says_in_another_process_what_is_said_in_this_one(lab, tmp_path):
    folder, (path, value) = lab
    command("diagnose", folder, "--out", "one", cwd=tmp_path)
    text = (tmp_path / "one" / "diagnosis.json").read_text()
    given = load_model(folder / "model.toml")
    assert diagnose(check_dataset(read_dataset(folder), given), given).text() == text
    document = json.loads(text)
    assert document["verdict"] == "parameters"
    assert document["parameters"][path]["to"] == pytest.approx(value, rel=0.05)
    assert all(gap["after"] < 1.2 * gap["floor"] for gap in document["gap"].values())
    assert load_model(tmp_path / "one" / "model.toml").plant == "station"
    assert "<html" in (tmp_path / "one" / "report.html").read_text()


@pytest.mark.campaign
def test_a_fit_finds_what_is_off(lab, tmp_path):
    folder, (path, value) = lab
    command("fit", folder, cwd=tmp_path)
    document = json.loads((tmp_path / "lab-fit" / "fit.json").read_text())
    assert document["parameters"][path]["low"] <= value <= document["parameters"][path]["high"]
