"""The contract: what a verdict needs before it denies missing structure."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.acceptance_floors import Stated, acceptance_floors, is_summary
from pma_gym.discovery.verdict.worsened import worsened
from pma_gym.discovery.workflow import refit
from pma_gym.estimation.logged import Logged
from pma_gym.plant.plant import Plant
from pma_gym.plant.rigs import RIGS
from tests.discovery.laboratory import BUMP, HYSTERESIS, LEVELS, STATION, commanded, measured

TRUE = dict(zip(RIGS["station"].outputs, LEVELS, strict=True))


def logs(trials):
    return [Logged.of(STATION, i, trial) for i, trial in enumerate(trials)]


def named(trials, **about):
    return [NamedTrial(f"{i}.csv", trial, **about) for i, trial in enumerate(trials)]


def floors(trials, stated=None):
    return acceptance_floors(logs(trials), named(trials), stated or Stated())


def moving(number):
    """Triangles that begin settled and go on until the log ends: nothing rests in them."""
    pieces = []
    for trial in measured(STATION, number, kinds=(0,)):
        rows = (trial.time >= 0.5) & (trial.time < 4.0)
        commands = {name: row[rows] for name, row in trial.commands.items()}
        readings = {name: row[rows] for name, row in trial.measurements.items()}
        pieces.append(Trial(trial.time[rows], commands, readings))
    return pieces


def rounded(trial, step):
    """As an encoder reads the contraction (m)."""
    read = step * np.round(trial.measurements["contraction"] / step)
    return replace(trial, measurements={**trial.measurements, "contraction": read})


# -- floors ----------------------------------------------------------------------------------------


def test_a_tolerance_comes_before_rest_and_repeats_before_a_tolerance():
    trials, plant, stated = measured(STATION, 6), Plant(STATION), Stated({"contraction": 2e-4})
    levels = floors(trials, stated)
    assert (levels["contraction"].source, levels["contraction"].level) == ("tolerance", 2e-4)
    for name in ("rotation", "load", "pressure"):
        assert levels[name].source == "rest segments"
        assert levels[name].level == pytest.approx(TRUE[name], rel=0.25)
    levels = floors([plant.simulate(commanded(1)[0], seed=seed) for seed in (1, 2, 3)], stated)
    for name, level in TRUE.items():
        assert levels[name].source == "repeats"
        assert levels[name].level == pytest.approx(level, rel=0.15)
    # A file that was copied is no repeat.
    assert floors([trials[0], trials[0]])["load"].source == "rest segments"


@pytest.mark.parametrize(("step", "tolerance"), [(0.0, 1e-5), (2.5e-4, 3e-5)])
def test_a_tolerance_that_is_finer_than_the_readings_is_no_structure(step, tolerance):
    """Of a sensor's noise, and of an encoder's rounding; the signals keep to commands that move."""
    trials = [rounded(trial, step) if step else trial for trial in moving(3)]
    level = np.hypot(TRUE["contraction"], step / np.sqrt(12.0))
    stated = {name: 0.3 * level for name, level in TRUE.items()} | {"contraction": tolerance}
    asked = Dataset("Logs", None, tuple(named(trials)), tolerance=stated)
    diagnosis = refit(asked, STATION)
    assert diagnosis.verdict in ("agrees", "parameters"), diagnosis.sentence
    judged = diagnosis.adequacy["contraction_mm"]
    assert judged.source == "readings' noise"
    assert judged.floor == pytest.approx(1e3 * level, rel=0.15)
    (said,) = (each for each in diagnosis.warnings if each.startswith("contraction_mm"))
    assert f"the tolerance of {1e3 * tolerance:g} mm is finer than the readings' noise of" in said


def test_the_scatter_of_repeats_holds_what_the_rig_does_not_repeat():
    """A rig whose drive pulls 2 % harder every other day scatters by more than its sensors."""
    strong = STATION.replace({"drive.gain_n_per_v": 100.0})
    trial = commanded(1)[0]
    repeats = [Plant(each).simulate(trial, seed=k) for k, each in enumerate((STATION, strong))]
    levels = floors(repeats)
    assert levels["load"].level > 5.0 * TRUE["load"]
    assert levels["pressure"].level == pytest.approx(TRUE["pressure"], rel=0.1)


def test_repeats_that_share_the_phase_of_mains_are_no_quieter_than_rest():
    """The hum of two repeats cancels in their difference; that of other trials does not."""
    plant, trials = Plant(STATION), []
    for seed in (1, 2):
        trial = plant.simulate(commanded(1)[0], seed=seed)
        hum = 2.0 * TRUE["pressure"] * np.sin(2.0 * np.pi * 50.0 * trial.time)
        read = {**trial.measurements, "pressure": trial.measurements["pressure"] + hum}
        trials.append(replace(trial, measurements=read))
    each = logs(trials), named(trials), Stated()
    quiet = acceptance_floors(*each)["pressure"].level
    assert quiet == pytest.approx(TRUE["pressure"], rel=0.15)
    loud = acceptance_floors(*each, {"pressure"})["pressure"].level
    assert loud == pytest.approx(np.sqrt(3.0) * TRUE["pressure"], rel=0.15)


def test_neither_what_never_rests_nor_an_encoder_that_stands_still_at_rest_has_a_floor():
    assert floors(moving(3)) == {}
    assert floors([Plant(STATION).simulate(each, noise=False) for each in commanded(3)]) == {}


def test_of_a_summary_the_printed_standard_errors_count():
    trial = measured(STATION, 1)[0]
    few = np.arange(len(trial)) % 40 == 0
    rows = {name: np.where(few, row, np.nan) for name, row in trial.measurements.items()}
    trials = [replace(trial, measurements=rows)]
    assert is_summary([rows["load"]]) and not is_summary([trial.measurements["load"]])
    levels = floors(trials, Stated(standard_error={"load": 3.0}))
    assert (levels["load"].source, levels["load"].level) == ("standard errors", 3.0)


# -- verdicts --------------------------------------------------------------------------------------


def test_what_neither_repeats_nor_rests_agrees_by_a_tolerance_alone():
    """Trials that always move, and exact sensors at rest."""
    stated = {name: 2.0 * level for name, level in TRUE.items()}
    exact = [Plant(STATION).simulate(each, noise=False) for each in commanded(4)]
    for trials in (moving(6), exact):
        open_, content = (
            refit(Dataset("lab", None, tuple(named(trials)), tolerance=tolerance), STATION)
            for tolerance in ({}, stated)
        )
        assert (open_.verdict, content.verdict) == ("undecidable", "agrees")
        assert "neither a repeat, a rest segment nor a tolerance" in open_.sentence
        assert "[tolerance], " in open_.sentence and "_mm = a number in mm" in open_.sentence
        assert "within 0.0493 mm in contraction" in content.sentence


@pytest.mark.parametrize("hidden", [HYSTERESIS, BUMP], ids=["hysteresis", "bump"])
def test_a_refit_alone_does_not_call_a_wrong_structure_right(hidden):
    (effect, table), *_ = hidden.items()
    twice = {name: value * (1 + name.endswith("_n")) for name, value in table.items()}
    diagnosis = refit(measured(STATION.with_effects({effect: twice}), 6), STATION)
    assert diagnosis.verdict == "unknown"
    assert "parameters alone do not explain that" in diagnosis.sentence
    assert "noise floors" in diagnosis.sentence


# -- signals --------------------------------------------------------------------------------------


def test_a_signal_that_got_worse_is_named_and_noise_is_not(example):
    records = [replace(each, before=each.after) for each in example.trials]
    sizes = dict(zip(records[0].columns, LEVELS, strict=True))
    assert worsened(records, sizes, 0) == ((), ())
    shift = 2.0 * LEVELS * (np.array(records[0].columns) == "load_n")
    worse = [replace(each, after=each.after + shift) for each in records]
    assert worsened(worse, sizes, 0) == (("load_n",), tuple(each.name for each in records))
