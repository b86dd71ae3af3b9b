"""Which parameters are off: the fewest that explain the trials, and none where none is."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.discovery.fewest import fewest
from pma_gym.discovery.parameters import values
from pma_gym.discovery.selection import relearnt
from tests.discovery.laboratory import STATION, bench, measured

INTERCEPT = "contractile_force.intercept_n"


def found(model, seed):
    """The fewest parameters that are off in trials of a model, as the station sees them."""
    shared = bench(measured(model, 4, rate=32.0, seed=seed))
    fit = shared.fit(STATION)
    assert fit is not None
    shared = replace(shared, noise=relearnt(shared, fit, ()))
    fit = shared.fit(fit.model)
    assert fit is not None
    few = fewest(shared, fit)
    assert few is not None
    return few.fit, fit


@pytest.mark.parametrize("seed", [5, 6])
def test_nothing_is_off_where_nothing_is(seed):
    few, _ = found(STATION, seed)
    assert few.paths == ()


def test_a_parameter_that_hides_behind_others_is_named():
    """With all of them free, the intercept of the force moves by less than its error."""
    given = float(values(STATION, [INTERCEPT])[0])
    few, free = found(STATION.replace({INTERCEPT: 1.2 * given}), 11)
    value, error = free.estimate(INTERCEPT)
    assert abs(value - given) < 3.0 * error
    assert few.paths == (INTERCEPT,)
    value, error = few.estimate(INTERCEPT)
    assert abs(value - given) > 5.0 * error
    assert value == pytest.approx(1.2 * given, abs=2.5 * error)


def test_what_is_off_is_estimated_more_surely_where_nothing_else_is_free():
    off = {"drive.gain_n_per_v": 101.0, INTERCEPT: 53.5}
    few, free = found(STATION.replace(off), 12)
    assert set(few.paths) == set(off)
    for path, truth in off.items():
        value, error = few.estimate(path)
        assert error <= free.estimate(path)[1]
        assert np.abs(value - truth) < 3.0 * error
