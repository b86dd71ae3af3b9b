"""Other rigs and other logs: what is hidden in them is named, and nothing where nothing is."""

import csv
import tomllib

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pma_gym.envs  # noqa: F401
from pma_gym.data.calibration import LVDT
from pma_gym.data.clipping import ends
from pma_gym.data.dataset import read_dataset
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import TrialError
from pma_gym.data.trial_files import write_trial
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.model import ModelError, parse_model
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import STATION, only
from tests.discovery.rig_trials import (
    FROZEN,
    SLIDE,
    at,
    driven_slide,
    hanging_load,
    logged,
)

DRIVEN = FROZEN / "driven_slide" / "model.toml"


def named(found):
    return [effect.name for effect in found.effects]


def uneven(rate, lane, seconds):
    """Times of a log that jitter by a fifth of a row, one row in twelve dropped."""
    generator = np.random.default_rng(lane)
    times = at(rate, seconds)
    times[1:-1] += generator.uniform(-0.2, 0.2, times.size - 2) / rate
    kept = generator.random(times.size) > 1 / 12
    kept[[0, -1]] = True
    return times[kept]


def uneven_with_other_channels():
    channels = (("contraction",), ("contraction", "pressure"), ("rotation", "load"))
    return [only(logged(k, uneven(384, k, 2.5)), *channels[k]) for k in range(3)]


def test_hysteresis_is_named_in_uneven_logs_of_other_channels():
    found = diagnose(uneven_with_other_channels(), STATION, propose=False)
    assert found.verdict == "effect", found.sentence
    assert named(found) == ["hysteresis"], found.sentence
    assert found.effects[0].parameters["force_n"].value == pytest.approx(8.0, rel=0.25)


@pytest.fixture(scope="module")
def raw_volts(tmp_path_factory):
    """Logs at 50 Hz of raw volts, whose LVDT is too short for the rig: it ends at 3.2 V."""
    folder = tmp_path_factory.mktemp("lab")
    for lane in range(3):
        log = only(logged(lane, at(50, 3.5)), "contraction", "pressure")
        volts = np.minimum(LVDT.to_volts(log.measurements["contraction"]), 3.2)
        with open(folder / f"run_{lane}.csv", "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["ms", "motor_voltage_v", "regulator_voltage_v", "Weg_V", "p_bar"])
            motor, regulator = log.commands["motor_voltage"], log.commands["regulator_voltage"]
            bar = log.measurements["pressure"] / 1e5
            writer.writerows(zip(1e3 * log.time, motor, regulator, volts, bar, strict=True))
    (folder / "dataset.toml").write_text(
        "[columns]\n"
        'ms = { name = "time_s", factor = 0.001 }\n'
        'p_bar = { name = "pressure_kpa", factor = 100 }\n'
        'Weg_V = { name = "contraction_mm", factor = 10.214505, offset = 8.998979 }\n'
    )
    return folder


def test_a_sensor_that_ends_is_seen_and_hysteresis_named_from_raw_volts(raw_volts):
    found = diagnose(read_dataset(raw_volts), STATION, propose=False)
    (said,) = (words for words in found.warnings if "contraction_mm" in words)
    assert "end of its sensor's range, 41.68" in said
    assert "readings of run_0.csv, number 1 to" in said and "as not measured" in said
    assert named(found) == ["hysteresis"], found.sentence


def test_no_sensor_of_the_frozen_trials_is_taken_for_one_that_ends():
    for folder in sorted(path for path in (FROZEN.parent / "hidden").iterdir() if path.is_dir()):
        trials = [each.trial for each in read_dataset(folder).trials]
        assert ends(trials) == [], folder.name


def test_of_one_long_trial_stretches_are_left_out():
    found = diagnose(read_dataset(FROZEN / "one_long_trial"), STATION, propose=False)
    assert named(found) == ["hysteresis"], found.sentence
    assert all(gap.held_out for gap in found.gap.values())
    assert any("stretch of its time is left out" in words for words in found.warnings)


def test_a_driven_slide_moves_as_newton_says():
    time = np.arange(0.0, 1.0, 1e-3)
    trial = Trial(time, {"load_command": 100.0 * np.sin(6.0 * time)})
    moved = Plant(DRIVEN).simulate(trial, noise=False)
    assert list(moved.measurements) == ["contraction"]

    def rate(at, state):
        load = np.interp(at, time, trial.commands["load_command"])
        return [state[1], (-load - 50.0 * state[1]) / 5.0]

    exact = solve_ivp(rate, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(moved.truth["contraction"], exact.y[0], atol=2e-6)


def test_nothing_is_claimed_of_a_driven_slide_whose_parameters_are_off():
    found = diagnose(driven_slide(), DRIVEN, propose=False)
    assert found.verdict == "parameters" and not found.effects, found.sentence
    assert found.model.parameters["slide"].mass == pytest.approx(SLIDE["mass"], rel=0.01)
    viscous = found.model.parameters["symmetric_damping"].intercept
    assert viscous == pytest.approx(SLIDE["viscous"], rel=0.03)


def thirty_pulls():
    return driven_slide(12.0, lanes=30, seconds=0.4, rate=100)


def one_long_drive():
    return driven_slide(12.0, lanes=1, seconds=10.0)


@pytest.mark.parametrize("log", [thirty_pulls, one_long_drive])
def test_dry_friction_is_found_in_a_driven_slide_and_is_not_taken_for_viscous(log):
    found = diagnose(log(), DRIVEN, propose=False)
    assert found.verdict == "effect", found.sentence
    assert named(found) == ["coulomb_friction"], found.sentence
    # Without the friction the viscous damping comes out six times as large.
    dynamic = found.effects[0].parameters["dynamic_n"].value
    assert dynamic == pytest.approx(12.0, rel=0.05)
    viscous = found.model.parameters["symmetric_damping"].intercept
    assert viscous == pytest.approx(SLIDE["viscous"], rel=0.15)
    assert all(gap.held_out for gap in found.gap.values())
    cut = any("nothing holds this slide" in words for words in found.warnings)
    assert cut == (log is one_long_drive)


def test_dry_friction_is_found_at_one_and_two_kilohertz():
    rates = enumerate((1000, 2000))
    logs = [driven_slide(12.0, lanes=2, seconds=1.5, rate=rate)[k] for k, rate in rates]
    found = diagnose(logs, DRIVEN, propose=False)
    assert named(found) == ["coulomb_friction"], found.sentence
    assert found.effects[0].parameters["dynamic_n"].value == pytest.approx(12.0, rel=0.1)


@pytest.mark.parametrize("hidden", ["nothing", "creep"])
def test_creep_is_named_in_a_muscle_that_lifts_weights(hidden):
    found = diagnose(hanging_load(hidden), FROZEN / "hanging_load" / "model.toml", propose=False)
    if hidden == "nothing":
        assert found.verdict == "parameters" and not found.effects, found.sentence
        return
    assert named(found) == ["creep"], found.sentence
    size = found.effects[0].parameters
    assert size["stiffness_n_per_mm"].value == pytest.approx(3.0, rel=0.1)
    assert size["time_constant_s"].value == pytest.approx(0.7, rel=0.1)


def test_a_push_on_a_cable_is_refused_with_what_to_do():
    with pytest.raises(TrialError, match=r"cannot push.*two_way_drive"):
        diagnose(driven_slide(), STATION)


def test_a_slide_without_its_start_is_refused_with_what_to_write():
    document = tomllib.loads(DRIVEN.read_text(encoding="utf-8"))
    del document["start"]
    with pytest.raises(ModelError, match=r"needs \[start\].*contraction_mm, velocity_mm_per_s"):
        parse_model(document)


def test_a_free_slide_may_go_further_than_any_muscle(tmp_path):
    trial = driven_slide()[0]
    far = {"contraction": 10.0 + trial.measurements["contraction"]}
    write_trial(Trial(trial.time, trial.commands, far), tmp_path / "far.csv")
    (read,) = read_dataset(tmp_path).trials
    np.testing.assert_allclose(read.trial.measurements["contraction"], far["contraction"])


def test_a_slide_is_no_rig_of_the_environments():
    with pytest.raises(ValueError, match="station or a cascade, got driven_slide, a slide"):
        gym.make("pma_gym/IsokineticDisplacement-v0", model=str(DRIVEN))
