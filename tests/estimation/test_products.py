"""Products of residuals are those of linear algebra, whoever computes them and however they lie."""

import numpy as np
import pytest

from pma_gym.estimation.products import Signals, products

SENSORS = 3


def course(rows, central, seed=0, parameters=3):
    """A trial's signals, strided as states are, and the weighted differences in NumPy."""
    draw = np.random.default_rng(seed)
    tried = 1 + parameters * (2 if central else 1)
    states = draw.normal(size=(tried, rows, 7))
    measured, weights = draw.normal(size=(SENSORS, rows)), draw.uniform(0.5, 2, (SENSORS, rows))
    weights[draw.uniform(size=weights.shape) < 0.2] = 0.0
    signals = Signals([states[:, :, 2 * i] for i in range(SENSORS)], measured, weights, central)
    every = []
    for simulated, there, weight in zip(signals.simulated, measured, weights, strict=True):
        moved = simulated[1 : 1 + parameters]
        changes = 0.5 * (moved - simulated[1 + parameters :]) if central else moved - simulated[0]
        every.append(np.concatenate([[simulated[0] - there], changes]) * weight)
    return signals, np.concatenate(every, axis=1)


@pytest.mark.parametrize("central", [False, True])
@pytest.mark.parametrize("rows", [1, 7, 8, 9, 500])
def test_they_are_those_of_the_differences(rows, central):
    signals, differences = course(rows, central)
    (sums,) = products([signals])
    truth = differences @ differences.T
    np.testing.assert_allclose(sums, truth, rtol=1e-12, atol=1e-14 * np.abs(truth).max())
    np.testing.assert_array_equal(sums, sums.T)


def test_neither_other_trials_nor_threads_change_a_bit():
    several = [course(rows, False, rows)[0] for rows in (5, 60, 700, 8, 33)]
    alone = [products([one])[0] for one in several]
    for threads in (1, 2, 3, 7):
        for sums, truth in zip(products(several, threads), alone, strict=True):
            np.testing.assert_array_equal(sums, truth)


def test_what_counts_for_nothing_may_be_no_number():
    signals, differences = course(20, False)
    for simulated, measured, weights in zip(
        signals.simulated, signals.measured, signals.weights, strict=True
    ):
        weights[13] = 0.0
        simulated[:, 13], measured[13] = np.nan, np.inf
    (sums,) = products([signals])
    left = np.delete(differences, [13, 33, 53], axis=1)
    np.testing.assert_allclose(sums, left @ left.T, rtol=1e-12)
    signals.weights[0][12] = 1.0
    signals.simulated[0][:, 12] = np.nan
    assert np.isnan(products([signals])[0]).all()
