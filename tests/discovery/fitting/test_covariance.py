"""Errors of parameters: as the curvature says for noise, wider where a model is wrong."""

import numpy as np
from scipy.signal import lfilter

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.covariance import covariance
from tests.discovery.laboratory import STATION, fit_problem, measured


def widened(trials):
    """By how much errors exceed those of the curvature, for what the data determine."""
    shared = fit_problem(trials)
    fit = shared.fit(STATION)
    assert fit is not None
    known = np.isfinite(np.diag(fit.covariance))
    wide = covariance(shared, fit, ())
    return np.sqrt(np.diag(wide)[known] / np.diag(fit.covariance)[known])


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
