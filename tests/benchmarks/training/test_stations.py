"""No station that a policy is trained or validated on is one that a suite judges it by."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.stations import draw_station
from benchmarks.suites.suite import SuiteError
from benchmarks.training import stations
from benchmarks.training.stations import (
    TRAINING,
    VALIDATION,
    VALIDATION_FIRST,
    Stations,
    training_recipe,
)
from pma_gym.plant.model import load_model


def numbers_asked(monkeypatch, *given):
    """Numbers of the stations that many episodes get, and the recipes that they are drawn by."""
    asked = []
    monkeypatch.setattr(stations, "_station", lambda recipe, number, _: asked.append(number))
    drawn, generator = Stations("robust", *given), np.random.default_rng(0)
    nominal = load_model("station")
    for _ in range(3000):
        drawn(nominal, generator)
    return set(asked)


def test_training_and_validation_have_other_stations(monkeypatch):
    train = numbers_asked(monkeypatch)
    check = numbers_asked(monkeypatch, VALIDATION_FIRST, VALIDATION)
    assert train == set(range(TRAINING))
    assert check == set(range(VALIDATION_FIRST, VALIDATION_FIRST + VALIDATION))
    assert not train & check


@pytest.mark.parametrize("suite", ["robust", "hard"])
def test_never_the_suites_own_seed(suite):
    own = frozen_suite(suite).recipe
    recipe = training_recipe(suite)
    assert recipe.seed == own.training_seed != own.seed
    assert Stations(suite).recipe is recipe


def test_the_draws_differ_in_their_parameters():
    own, train = frozen_suite("robust").recipe, training_recipe("robust")
    models = [draw_station(own, 0).model, draw_station(own, 1).model]
    models += [draw_station(train, number).model for number in (0, 1, VALIDATION_FIRST)]
    vectors = {model.vector().tobytes() for model in models}
    assert len(vectors) == len(models)
    # One structure: one kernel serves them all.
    assert len({tuple(model.effects) for model in models}) == 1


def test_a_suite_without_stations_is_refused():
    with pytest.raises(SuiteError, match="draws no stations; train on those of robust"):
        training_recipe("nominal")
