"""Which parameters are off: the fewest that explain the trials, and none where none is."""

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery import workflow
from pma_gym.discovery.fitting.free_parameters import free_parameters, values
from pma_gym.discovery.verdict import decision
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import (
    STATION,
    commanded,
    diagnosed,
    laboratory,
    measured,
)

INTERCEPT = "contractile_force.intercept_n"
NAMED = "Parameters that are off: "


def said(diagnosis):
    """What it says of the fewest, or nothing."""
    return [step for step in diagnosis.steps if step.startswith(NAMED)]


def test_nothing_is_named_where_something_else_may_be_off(monkeypatch):
    assert said(diagnosed("parameters"))
    monkeypatch.setattr(workflow, "suspicious", lambda _: True)
    assert not said(diagnose(laboratory("parameters")[0], STATION, propose=False))


def test_the_given_model_is_proposed_where_no_parameter_is_off():
    """Commands that never change tell nothing: not that the model agrees, nor that it is off."""
    plant, trials = Plant(STATION), []
    for k, trial in enumerate(commanded(2)):
        held = {name: np.full(len(trial), row[0]) for name, row in trial.commands.items()}
        trials.append(plant.simulate(Trial(trial.time, held), seed=k))
    diagnosis = diagnose(trials, STATION, propose=False)
    assert diagnosis.verdict == "undecidable"
    assert diagnosis.model == STATION and not diagnosis.parameters
    assert all(gap.after == gap.before and gap.held_out for gap in diagnosis.gap.values())
    assert said(diagnosis) == [f"{NAMED}none of 20 is needed to explain these trials."]


def test_what_is_off_but_hardly_shows_leaves_the_model_as_it_is(monkeypatch):
    monkeypatch.setattr(decision, "SLIGHT", np.inf)
    diagnosis = diagnose(laboratory("parameters", 6)[0], STATION, propose=False)
    assert diagnosis.verdict == "agrees" and diagnosis.model == STATION
    (words,) = said(diagnosis)
    assert words.endswith("of the noise: the model stays as it was given.")


@pytest.mark.campaign
def test_intervals_hold_where_all_numbers_are_a_little_off():
    """Of named parameters some nine in ten, and far more than if the others were exact."""
    own, held = free_parameters(STATION), []
    for seed in (21, 22, 24, 25, 31, 36):
        chance = np.random.default_rng(seed)
        off = {
            path: float(value * (1.0 + chance.uniform(-0.1, 0.1) * (chance.random() < 0.7)))
            for path, value in zip(own.free, values(STATION, own.free), strict=True)
        }
        trials = measured(STATION.replace(off), 4, rate=32.0, seed=seed)
        diagnosis = diagnose(trials, STATION, propose=False)
        assert said(diagnosis)
        for path, moved in diagnosis.parameters.items():
            low, high = moved.now.low, moved.now.high
            assert low is not None and high is not None
            held.append(low <= off[path] <= high)
            note = diagnosis.model.notes[path]
            assert (note.low, note.high) == pytest.approx((low, high))
    assert len(held) > 30
    assert np.mean(held) > 0.8


@pytest.mark.parametrize(
    ("path", "factor", "named", "words"),
    [
        (INTERCEPT, 1.2, INTERCEPT, "if others are off instead"),
        (
            "damping.high_intercept_n_s_per_mm",
            1.5,
            "damping.high_slope_n_s_per_mm_per_kpa",
            "damping.high_intercept_n_s_per_mm does the same to the signals; if that one is off",
        ),
    ],
)
def test_a_named_parameter_that_another_could_stand_for_comes_with_a_note(
    path, factor, named, words
):
    given = float(values(STATION, [path])[0])
    trials = measured(STATION.replace({path: factor * given}), 4, rate=32.0, seed=11)
    diagnosis = diagnose(trials, STATION, propose=False)
    assert list(diagnosis.parameters) == [named]
    (warning,) = diagnosis.warnings
    assert warning.startswith(f"{named}: ")
    assert warning.endswith(f"{words}, {named} may be as it was given")
