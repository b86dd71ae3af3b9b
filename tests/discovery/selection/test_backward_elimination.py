"""Which parameters are off: the fewest that explain the trials, and none where none is."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery import workflow
from pma_gym.discovery.fitting.free_parameters import free_parameters, values
from pma_gym.discovery.screening.residuals import reestimated_noise
from pma_gym.discovery.selection.backward_elimination import backward_elimination
from pma_gym.discovery.verdict import decision
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import (
    STATION,
    commanded,
    diagnosed,
    fit_problem,
    laboratory,
    measured,
)

INTERCEPT = "contractile_force.intercept_n"
NAMED = "Parameters that are off: "


def eliminated(model, seed):
    """The fewest parameters that are off in trials of a model, as the station sees them."""
    shared = fit_problem(measured(model, 4, rate=32.0, seed=seed))
    fit = shared.fit(STATION)
    assert fit is not None
    shared = replace(shared, noise=reestimated_noise(shared, fit, ()))
    fit = shared.fit(fit.model)
    assert fit is not None
    few = backward_elimination(shared, fit)
    assert few is not None
    return few.fit, fit


@pytest.mark.parametrize("seed", [5, 6])
def test_nothing_is_off_where_nothing_is(seed):
    few, free = eliminated(STATION, seed)
    assert few.paths == () and few.model == STATION
    assert few.chi_square > free.chi_square


def test_a_parameter_that_hides_behind_others_is_named():
    """With all of them free, the intercept of the force moves by less than its error."""
    given = float(values(STATION, [INTERCEPT])[0])
    few, free = eliminated(STATION.replace({INTERCEPT: 1.2 * given}), 11)
    value, error = free.estimate(INTERCEPT)
    assert abs(value - given) < error
    assert few.paths == (INTERCEPT,)
    value, error = few.estimate(INTERCEPT)
    # A change of a fifth is 4.3 errors of it; these trials happen to show 5.0.
    assert abs(value - given) > 4.5 * error
    assert value == pytest.approx(1.2 * given, abs=2.0 * error)
    assert error < 0.5 * free.estimate(INTERCEPT)[1]


def test_what_is_off_is_estimated_more_surely_where_nothing_else_is_free():
    off = {"drive.gain_n_per_v": 101.0, INTERCEPT: 53.5}
    few, free = eliminated(STATION.replace(off), 12)
    assert set(few.paths) == set(off)
    for path, truth in off.items():
        value, error = few.estimate(path)
        assert error <= free.estimate(path)[1]
        assert np.abs(value - truth) < 3.0 * error


@pytest.mark.parametrize("less", [1e6, np.nan])
def test_a_given_model_that_explains_too_little_is_not_kept(less):
    """It is looked at as any other, even where no parameter is missed."""
    shared = fit_problem(measured(STATION, 4, rate=32.0, seed=5))
    fit = shared.fit(STATION)
    assert backward_elimination(shared, fit) is not None
    assert backward_elimination(shared, replace(fit, chi_square=fit.chi_square - less)) is None


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


@pytest.mark.campaign
def test_what_is_off_but_hardly_shows_leaves_the_model_as_it_is(monkeypatch):
    monkeypatch.setattr(decision, "MOVED_CHANGE", np.inf)
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
@pytest.mark.campaign
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
