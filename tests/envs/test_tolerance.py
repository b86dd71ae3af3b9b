"""An environment's tolerance: how exact the integration is, and at what price."""

import numpy as np

from pma_gym.plant.compiled_model import DEFAULT_TOLERANCE
from pma_gym.plant.plant import Plant

TOLERANCES = 3e-2, 1e-3, DEFAULT_TOLERANCE, 1e-5


def driven(env, steps=150):
    """True positions under random voltages, and how many attempts at internal steps it took."""
    voltages = np.random.default_rng(5).uniform(0.0, 3.0, steps)
    env.reset(seed=2)
    positions, attempts = [], 0
    for voltage in voltages:
        env.step(env.action(voltage))
        positions.append(env.position)
        attempts += env._engine.attempts
    return np.array(positions), attempts


def test_the_error_follows_the_tolerance_and_costs_steps(make):
    true, _ = driven(make(noise=False, tolerance=1e-8))
    rows = [driven(make(noise=False, tolerance=value)) for value in TOLERANCES]
    errors = [np.abs(positions - true).max() / np.ptp(true) for positions, _ in rows]
    assert errors == sorted(errors, reverse=True) and errors[0] > 30.0 * errors[-1] > 0.0
    attempts = [made for _, made in rows]
    assert attempts == sorted(attempts) and attempts[0] < 0.9 * attempts[2]


def test_the_default_is_the_plants(make):
    assert make().nominal_plant.tolerance == Plant("serres2008").tolerance == DEFAULT_TOLERANCE
    options = {"tolerance": DEFAULT_TOLERANCE}, {}
    given, left_out = (driven(make(**each)) for each in options)
    np.testing.assert_array_equal(given[0], left_out[0])
    assert given[1] == left_out[1]


def test_stations_that_are_drawn_have_it_too(make):
    env = make(randomisation="intervals", tolerance=2e-3)
    for seed in (1, 2):
        env.reset(seed=seed)
        assert env.plant is not env.nominal_plant
        assert env.plant.tolerance == env.nominal_plant.tolerance == 2e-3
    fine = driven(make(randomisation="intervals", noise=False, tolerance=1e-6))[0]
    rough = driven(make(randomisation="intervals", noise=False, tolerance=3e-2))[0]
    assert 1e-6 < np.abs(rough - fine).max() / np.ptp(fine) < 1e-2


def test_it_compiles_nothing_anew(make):
    one, other = make(), make(tolerance=1e-3)
    assert one._engine.kernel.library is other._engine.kernel.library
