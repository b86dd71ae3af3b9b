"""Trials beside a model: whitened sums, free zeros, pieces, parameters of single trials.

Ranges assumed beforehand: widened while a fit gains by it, never beyond what is possible.
"""

from functools import cache

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.assumed_range import (
    FARTHEST,
    MOST_DOUBLINGS,
    assumed_range,
    needed_reach,
)
from pma_gym.discovery.preparation.noise import Whitening, white_noise
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.workflow import refit
from tests.discovery.laboratory import LEVELS, OFF, STATION, fit_problem, measured

FREE = tuple(OFF)
NOISE = tuple(map(white_noise, LEVELS))
COLOURED = tuple(Whitening((0.5,), 0.8 * level, level) for level in LEVELS)
PRIOR = np.array([10.0, 0.3])
STEPS = np.array([0.01, 1e-3])


@pytest.fixture(scope="module")
def trials():
    return measured(STATION, 3, rate=64.0)


@pytest.fixture(scope="module")
def smooth():
    """Without noise."""
    return measured(STATION, 3, rate=64.0, noise=False)


def whitened_residuals(trials, noise=NOISE, prior=PRIOR, **kept):
    return WhitenedResiduals(STATION, trials, FREE, noise, prior, **kept)


def changed(trial, **measurements):
    return Trial(trial.time, trial.commands, {**trial.measurements, **measurements})


def test_chi_square_of_the_truth_is_the_number_of_readings():
    residuals = whitened_residuals(measured(STATION, 4, rate=128.0))
    chi_square = residuals.sums(residuals.start, np.empty(0)).chi_square
    # Two zeros of each trial are free.
    expected = residuals.count - 2 * residuals.trials
    assert abs(chi_square - expected) < 4 * np.sqrt(2 * expected)


def test_zeros_of_contraction_and_rotation_are_free(trials):
    before = whitened_residuals(trials).sums(whitened_residuals(trials).start, STEPS)
    moved = [
        changed(
            trial,
            contraction=trial.measurements["contraction"] + 2e-3 * k,
            rotation=trial.measurements["rotation"] - 0.1 * k,
        )
        for k, trial in enumerate(trials)
    ]
    after = whitened_residuals(moved).sums(whitened_residuals(moved).start, STEPS)
    assert after.chi_square == pytest.approx(before.chi_square, rel=1e-9)
    np.testing.assert_allclose(after.gradient, before.gradient, rtol=1e-6)


def test_zeros_of_load_and_pressure_are_not_free(trials):
    residuals = whitened_residuals(trials)
    before = residuals.sums(residuals.start, np.empty(0)).chi_square
    for name, size in (("load", 5.0), ("pressure", 5e3)):
        moved = [changed(trials[0], **{name: trials[0].measurements[name] + size}), *trials[1:]]
        assert (
            whitened_residuals(moved).sums(residuals.start, np.empty(0)).chi_square > before + 100
        )


@pytest.mark.parametrize("noise", [NOISE, COLOURED])
def test_pieces_sum_to_sums(trials, noise):
    residuals = whitened_residuals(trials, noise)
    values = residuals.start + np.array([0.1, 0.01])
    pieces, sums = residuals.pieces(values, STEPS), residuals.sums(values, STEPS)
    assert pieces is not None
    away = (values - residuals.start) / PRIOR
    total = pieces.total()
    assert total[0, 0] + away @ away == pytest.approx(sums.chi_square, rel=1e-12)
    np.testing.assert_allclose(total[1:, 0] + away / PRIOR, sums.gradient, rtol=1e-9)
    np.testing.assert_allclose(total[1:, 1:] + np.diag(PRIOR**-2), sums.curvature, rtol=1e-9)
    parts = sum(pieces.total([k]) for k in range(3))
    np.testing.assert_allclose(parts, total, rtol=1e-9)
    assert pieces.readings() == residuals.count
    assert sum(pieces.readings([k]) for k in range(3)) == residuals.count
    assert [int((pieces.trial == k).sum()) for k in range(3)] == [20, 20, 20]


def test_each_trial_counts_for_itself(trials):
    whole = whitened_residuals(trials).pieces(whitened_residuals(trials).start, STEPS)
    for k, trial in enumerate(trials):
        alone = whitened_residuals([trial])
        pieces = alone.pieces(alone.start, STEPS)
        np.testing.assert_allclose(pieces.total(), whole.total([k]), rtol=1e-9)


@pytest.mark.parametrize("noise", [NOISE, COLOURED])
def test_gradient_is_that_of_chi_square(trials, noise):
    residuals = whitened_residuals(trials, noise)
    values = residuals.start + np.array([0.2, -0.02])
    sums = residuals.sums(values, STEPS, central=True)
    for k, step in enumerate(STEPS):
        move = step * np.eye(2)[k]
        up, down = (residuals.sums(values + s * move, np.empty(0)).chi_square for s in (1, -1))
        assert (up - down) / (4 * step) == pytest.approx(sums.gradient[k], rel=1e-4)


def test_curvature_is_that_of_chi_square_where_the_model_is_right(smooth):
    residuals = whitened_residuals(smooth)
    sums = residuals.sums(residuals.start, STEPS, central=True)
    for k, step in enumerate(20 * STEPS):
        move = step * np.eye(2)[k]
        up, at, down = (
            residuals.sums(residuals.start + s * move, np.empty(0)).chi_square for s in (1, 0, -1)
        )
        assert (up - 2 * at + down) / (2 * step**2) == pytest.approx(sums.curvature[k, k], rel=0.02)


def test_values_of_its_own_change_a_trial_alone(trials):
    here = 1e-3 * STATION.values_in_files("rotor")["radius_mm"]
    plain, own = (
        whitened_residuals(trials, own={"rotor.radius_mm": row}).pieces(
            whitened_residuals(trials).start, STEPS
        )
        for row in ([here] * 3, [here, 1.05 * here, here])
    )
    none = whitened_residuals(trials).pieces(whitened_residuals(trials).start, STEPS)
    np.testing.assert_allclose(plain.products, none.products, rtol=1e-12)
    there = own.trial == 1
    assert np.array_equal(own.products[~there], plain.products[~there])
    assert own.total([1])[0, 0] > plain.total([1])[0, 0] + 100


def test_gaps_count_for_nothing(trials):
    generator = np.random.default_rng(4)
    gone = {}
    for name, row in trials[0].measurements.items():
        gone[name] = np.where(generator.random(len(row)) < 0.3, np.nan, row)
    residuals = whitened_residuals([changed(trials[0], **gone), *trials[1:]], COLOURED)
    pieces = residuals.pieces(residuals.start, STEPS)
    assert pieces is not None and np.isfinite(pieces.products).all()
    missing = sum(int(np.isnan(row).sum()) for row in gone.values())
    assert pieces.readings() == whitened_residuals(trials).count - missing
    plain = (
        whitened_residuals([changed(trials[0], **gone)])
        .sums(residuals.start, np.empty(0))
        .chi_square
    )
    count = pieces.readings([0]) - 2
    assert abs(plain - count) < 4 * np.sqrt(2 * count)


def test_a_prior_pulls_and_bounds():
    residuals = whitened_residuals(measured(STATION, 1))
    assert np.all(residuals.upper <= residuals.start + FARTHEST * PRIOR)
    assert np.all(residuals.lower >= residuals.start - FARTHEST * PRIOR)
    values = residuals.start + PRIOR
    held = residuals.sums(values, np.empty(0)).chi_square
    loose = whitened_residuals(measured(STATION, 1), prior=np.full(2, np.inf))
    free = loose.sums(values, np.empty(0)).chi_square
    assert held - free == pytest.approx(2.0, abs=1e-6 * free)


def test_threads_change_no_bit(trials):
    one, two = (
        whitened_residuals(trials, COLOURED, threads=threads).sums(
            whitened_residuals(trials).start, STEPS
        )
        for threads in (1, 2)
    )
    assert one.chi_square == two.chi_square
    assert np.array_equal(one.curvature, two.curvature)


def test_what_cannot_be_simulated_is_infinitely_bad(trials):
    residuals = WhitenedResiduals(
        STATION, trials, ("contractile_force.intercept_n",), NOISE, np.full(1, np.inf)
    )
    sums = residuals.sums(np.array([1e9]), np.ones(1))
    assert sums.chi_square == np.inf


GAIN = "drive.gain_n_per_v"


@cache
def strong_drive(factor):
    """Trials of a station whose drive is so many times as strong as its model says."""
    gain = factor * STATION.values_in_files("drive")["gain_n_per_v"]
    kinds = {"kinds": (0, 0), "kpa": (400.0, 520.0)}
    return measured(STATION.replace({GAIN: gain}), 2, rate=32.0, **kinds), gain


def test_a_range_reaches_six_standard_deviations_and_stays_within_the_possible():
    centre, prior = np.array([100.0, 0.5, 3.0]), np.array([10.0, 1.0, np.inf])
    lower, upper = np.array([0.0, -20.0, 0.0]), np.array([1000.0, 20.0, 200.0])
    low, high = assumed_range(centre, prior, lower, upper, np.ones(3))
    np.testing.assert_allclose(low, [100.0 - 10.0 * FARTHEST, 0.5 - FARTHEST, 0.0])
    np.testing.assert_allclose(high, [160.0, 6.5, 200.0])
    low, high = assumed_range(centre, prior, lower, upper, np.full(3, 2.0**MOST_DOUBLINGS))
    # A positive number comes nearer to 0 by halves; another ends where the catalogue ends.
    np.testing.assert_allclose(low, [40.0 / 32.0, -20.0, 0.0])
    np.testing.assert_allclose(high, [1000.0, 20.0, 200.0])


def test_what_lies_beyond_needs_as_many_doublings_as_hold_it():
    centre, prior = np.array([100.0, 100.0, 100.0]), np.full(3, 10.0)
    lower, upper = np.zeros(3), np.full(3, 1000.0)
    reach = needed_reach(np.array([150.0, 190.0, 15.0]), centre, prior, lower, upper)
    np.testing.assert_array_equal(reach, [1.0, 2.0, 4.0])


def test_a_fit_goes_beyond_what_was_assumed_where_the_trials_ask_for_it():
    trials, gain = strong_drive(2.0)
    shared = fit_problem(trials)
    fitted = shared.fit(STATION)
    assert fitted is not None
    assert fitted.estimate(GAIN)[0] == pytest.approx(gain, rel=0.01)
    assert fitted.reach[GAIN] == 2.0
    assert not shared.whitened_at(fitted).at_assumed_edge(fitted.values)


def test_a_fit_from_beyond_stays_there():
    trials, _ = strong_drive(2.0)
    first = fit_problem(trials).fit(STATION)
    assert first is not None
    again = fit_problem(trials).fit(first.model, trials=[0])
    assert again is not None and again.reach == first.reach
    assert again.estimate(GAIN)[0] == pytest.approx(first.estimate(GAIN)[0], rel=0.02)


def test_the_reader_is_told_what_went_beyond():
    trials, _ = strong_drive(2.0)
    diagnosis = refit(trials, STATION)
    (said,) = (words for words in diagnosis.warnings if words.startswith(GAIN))
    assert "beyond what is assumed beforehand (39.1 to 157 N/V)" in said
    assert "widened 2 times" in said
