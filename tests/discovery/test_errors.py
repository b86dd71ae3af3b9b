"""Errors of parameters: as the curvature says for noise, wider where a model is wrong; scatter."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from pma_gym.data.trial import Trial
from pma_gym.discovery.constancy import spreads
from pma_gym.discovery.errors import covariance
from pma_gym.discovery.suspects import suspects
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import HYSTERESIS, STATION, bench, commanded, measured

LAW = next(each for each in suspects(STATION) if each.name == "hysteresis")
START = {"hysteresis": np.array([6.0, 1.0])}


def widened(trials):
    """By how much errors exceed those of the curvature, for what the data determine."""
    shared = bench(trials)
    fit = shared.fit(STATION)
    assert fit is not None
    known = np.isfinite(np.diag(fit.covariance))
    found = covariance(shared, fit, ())
    return np.sqrt(np.diag(found)[known] / np.diag(fit.covariance)[known])


def test_white_noise_hardly_widens_errors():
    wider = widened(measured(STATION, 6, noise=True))
    assert np.all(wider >= 1.0)
    assert np.median(wider) < 1.3


def test_what_is_left_for_seconds_widens_errors():
    def wandering(trial, seed):
        white = np.random.default_rng(seed).standard_normal(len(trial))
        slow = lfilter([0.3], [1.0, -0.95], white) * 1e-4
        held = trial.measurements["contraction"] + np.asarray(slow)
        return Trial(trial.time, trial.commands, {**trial.measurements, "contraction": held})

    trials = measured(STATION, 6)
    slow = [wandering(trial, seed) for seed, trial in enumerate(trials)]
    assert widened(slow).max() > 2.0
    assert widened(slow).max() > 1.5 * widened(trials).max()


@cache
def scatter(*forces):
    """Spread of hysteresis whose force (N) differs from trial to trial."""
    models = [
        STATION.with_effects({"hysteresis": HYSTERESIS["hysteresis"] | {"force_n": force}})
        for force in forces
    ]
    trials = [
        Plant(model).simulate(trial, seed=k, noise=True)
        for k, (model, trial) in enumerate(
            zip(models, commanded(len(forces), kinds=(0,)), strict=True)
        )
    ]
    shared = bench(trials)
    fit = shared.fit(STATION, (LAW,), START)
    assert fit is not None
    return spreads(shared, fit, (LAW,), 0)


def test_an_effect_of_one_size_does_not_scatter():
    found = scatter(6.0, 6.0, 6.0, 6.0)
    assert set(found) == {"trial", "contraction", "load", "pressure"}
    assert max(found.values()) < 0.05


def test_an_effect_of_two_sizes_scatters_by_trial_as_it_was_made():
    # A third of the mean of 6 N.
    assert scatter(4.0, 8.0, 4.0, 8.0)["trial"] == pytest.approx(1.0 / 3.0, abs=0.12)
