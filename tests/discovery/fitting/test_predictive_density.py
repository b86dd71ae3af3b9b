"""What a fit says of a trial that it has not seen: as sure as the others make it."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting import predictive_density
from pma_gym.discovery.fitting.fit_problem import Fitted
from pma_gym.discovery.fitting.predictive_density import PredictiveDensity, freedom, unabsorbed
from pma_gym.discovery.workflow import diagnose
from pma_gym.estimation.residuals import Sums
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import HYSTERESIS, OFF, STATION, measured


def test_parameters_absorb_what_a_least_squares_fit_with_their_prior_does():
    generator = np.random.default_rng(1)
    by, apart = generator.standard_normal((2, 40)), generator.standard_normal((3, 40))
    covariance = np.array([[4.0, 1.0], [1.0, 0.5]])
    fit = Fitted(STATION, (), ("a", "b"), np.ones(2), covariance, 0.0, np.ones(2), True)
    weights = np.linalg.cholesky(np.linalg.inv(covariance)).T
    stacked = np.concatenate([by.T, weights])
    for row, left in zip(apart, unabsorbed(apart, by, fit), strict=True):
        right = np.concatenate([-row, np.zeros(2)])
        rest = right - stacked @ np.linalg.lstsq(stacked, right, rcond=None)[0]
        assert left == pytest.approx(rest @ rest)


def test_what_no_trial_told_is_absorbed_whole():
    by = np.ones((1, 30))
    fit = Fitted(*(STATION, (), ("a",), np.ones(1), np.array([[np.inf]]), 0.0, np.ones(1), True))
    assert unabsorbed(7.0 * by, by, fit)[0] == pytest.approx(0.0, abs=1e-4)


PRIOR = np.array([[2.0, 0.3], [0.3, 0.5]])


class Straight:
    """Trials whose whitened residuals go straight with two parameters, and their best fit."""

    def __init__(self, residual, by, prior=PRIOR, width=1e6):
        self.lower, self.upper = np.full(2, -0.5 * width), np.full(2, 0.5 * width)
        self.curvature = by @ by.T + prior
        values = -np.linalg.lstsq(self.curvature, by @ residual)[0]
        left = residual + values @ by
        chi_square = left @ left + values @ prior @ values
        nothing = np.empty((2, 2))
        self.fit = Fitted(
            STATION, (), ("a", "b"), values, nothing, chi_square, np.ones(2), converged=True
        )

    def sums(self, values, steps):
        return Sums(0.0, np.zeros(2), self.curvature)


def surprised(residual, by, seen, **options):
    some, every = (Straight(residual[:k], by[:, :k], **options) for k in (seen, len(residual)))
    return PredictiveDensity(every.fit, freedom(every, every.fit)).deviance(some, some.fit)


def test_surprise_is_the_likelihood_given_what_seen_trials_say_of_parameters(monkeypatch):
    monkeypatch.setattr(predictive_density, "WIDE", 1e9)
    generator = np.random.default_rng(4)
    residual, by = generator.standard_normal(12), generator.standard_normal((2, 12))
    seen = Straight(residual[:7], by[:, :7])
    rest = by[:, 7:]
    covariance = np.eye(5) + rest.T @ np.linalg.inv(seen.curvature) @ rest
    expected = multivariate_normal(-seen.fit.values @ rest, covariance).logpdf(residual[7:])
    surprise_value = surprised(residual, by, 7)
    assert surprise_value == pytest.approx(-2.0 * expected - 5 * np.log(2.0 * np.pi))


def test_what_the_seen_trials_do_not_hold_costs_its_freedom_alone():
    by = np.concatenate([np.zeros((2, 5)), np.ones((2, 30)) * [[1.0], [0.0]]], axis=1)
    residual = np.concatenate([np.zeros(5), np.full(30, 7.0)])
    surprise_value = surprised(residual, by, 5, prior=np.zeros((2, 2)), width=20.0)
    assert surprise_value == pytest.approx(np.log(30.0 * 20.0**2 + 1.0))
    # Bounds that reach far beyond the parameter's size, 7, cost no more than ten times that.
    wide = surprised(residual, by, 5, prior=np.zeros((2, 2)), width=1e9)
    assert wide == pytest.approx(np.log(30.0 * 70.0**2 + 1.0))


def test_trials_that_cannot_be_simulated_surprise_without_end():
    residual, by = np.ones(12), np.ones((2, 12))
    every, seen = Straight(residual, by), Straight(residual[:5], by[:, :5])
    whole = PredictiveDensity(every.fit, freedom(every, every.fit))
    seen.curvature = np.full((2, 2), np.nan)
    assert whole.deviance(seen, seen.fit) == np.inf


def held(volts, kpa, truth, seed):
    """A trial in which nothing moves."""
    plant, time = Plant(truth), np.arange(0.0, 5.0, 1.0 / 64.0)
    regulator = plant.regulator_voltage(1e3 * kpa) + 0.0 * time
    commands = {"motor_voltage": volts + 0.0 * time, "regulator_voltage": regulator}
    return plant.simulate(Trial(time, commands), seed=seed)


@pytest.mark.campaign
def test_an_effect_that_one_trial_of_three_shows_is_named():
    """The other two hold neither it nor the parameters: of them alone the third is a guess."""
    truth = STATION.with_effects(HYSTERESIS).replace(OFF)
    trials = [held(3.0, 300.0, truth, 1), held(5.0, 420.0, truth, 2)]
    diagnosis = diagnose([*trials, *measured(truth, 1, kinds=(1,))], STATION, propose=False)
    assert diagnosis.verdict == "effect", diagnosis.sentence
    (effect,) = diagnosis.effects
    assert effect.name == "hysteresis"
    # One trial, whose start is free, tells the force less well than many.
    assert effect.parameters["force_n"].value == pytest.approx(6.0, rel=0.2)
