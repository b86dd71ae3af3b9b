"""Bursts in a residual: noise makes none, coloured or rounded, nor lone readings; a beat is one.

What a residual remembers of itself: nothing if it is noise, what was put in if it is not.
"""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from pma_gym.discovery.preparation.noise import Whitening
from pma_gym.discovery.screening.autocorrelation import autocorrelation_test, tone
from pma_gym.discovery.screening.scan_statistic import (
    CHANCE,
    NO_EXCESS,
    autocorrelation,
    noise_of,
    scan_statistic,
    tail,
)

ROWS, PARTS = 1024, 6
EDGES = [[32 * k for k in range(33)]] * PARTS
BEAT = np.array([5.0, 12.0, -20.0, 6.0])
"""What a cable that comes taut leaves in a load, over the noise."""


def noise(seed, memory=0.0):
    """Noise of variance 1 that follows itself by one coefficient, shape (parts, rows)."""
    white = np.random.default_rng(seed).standard_normal((PARTS, ROWS + 100))
    return np.asarray(lfilter([np.sqrt(1 - memory**2)], [1, -memory], white, axis=1))[:, 100:]


def scan_of(parts, level=1.0, step=0.0):
    return scan_statistic(list(parts), EDGES, level, step)


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_the_bound_holds_for_the_largest_piece_of_coloured_noise(memory):
    colour = autocorrelation(Whitening((memory,), np.sqrt(1 - memory**2), 1.0), 32)
    weights = np.linalg.eigvalsh(toeplitz(colour))
    power = np.concatenate([(noise(k, memory).reshape(-1, 32) ** 2).sum(axis=1) for k in range(99)])
    chances = np.array([tail(each, weights) for each in power])
    for level in (0.1, 0.01, 0.001):
        share = np.mean(chances <= level)
        # Pieces of one trial are nearly independent; a bound may be passed by its own scatter.
        assert share < level + 4 * np.sqrt(level / len(chances))
        assert share > 0.02 * level


@pytest.mark.parametrize("memory", [0.0, 0.5])
@pytest.mark.parametrize("step", [0.0, 1.0, 3.0])
def test_noise_does_not_burst_be_it_coloured_or_rounded(memory, step):
    creep = np.sin(np.linspace(0.0, 3.0, ROWS))
    for seed in range(40):
        parts = noise(seed, memory)
        level = 1.0
        if step:
            # Rounding follows what creeps, and what stands still stays beside the truth.
            parts = np.round((parts + 2.0 * creep) / step) * step - 2.0 * creep
            level = max(np.sqrt(np.mean(parts[0, :96] ** 2)), step / np.sqrt(12.0))
        assert scan_of(parts, level, step).chance > 0.01
        assert scan_of(parts, level, step).excess == 0.0


def test_noise_larger_everywhere_than_at_rest_does_not_burst():
    assert all(scan_of(3.0 * noise(seed, 0.5)).excess == 0.0 for seed in range(20))


@pytest.mark.parametrize("memory", [0.0, 0.5])
def test_a_beat_in_one_piece_of_one_trial_is_a_burst_of_its_size(memory):
    for seed in range(10):
        parts = noise(seed, memory)
        parts[2, 330:334] += BEAT
        beat = scan_of(parts)
        assert beat.chance < CHANCE
        assert beat.excess == pytest.approx(np.sum(BEAT**2), rel=0.25)


def test_one_wild_reading_is_none_however_wild_nor_are_many_that_come_alone():
    for seed in range(10):
        parts = noise(seed, 0.5)
        parts[3, 500] += 1e4
        assert scan_of(parts).excess == 0.0
        # One reading in a hundred: some pieces have three of them.
        generator = np.random.default_rng(seed)
        thrown = generator.random((PARTS, ROWS)) < 0.01
        assert scan_of(noise(seed) + np.where(thrown, 30.0, 0.0)).excess == 0.0


def test_rounding_by_a_half_step_is_taken_off():
    parts = 0.3 * noise(0)
    parts[0, 320:352] += 1.5
    assert scan_of(parts, 0.3, 0.0).chance < CHANCE
    assert scan_of(parts, 0.3, 3.0).excess == 0.0


def test_a_beat_hardly_moves_the_noise_that_it_is_judged_by():
    parts = noise(1, 0.5)
    plain = noise_of(list(parts), 0.9)
    parts[2, 330:334] += 10.0 * BEAT
    moved = noise_of(list(parts), 0.9)
    assert moved.level == pytest.approx(plain.level, rel=0.01)
    assert moved.coefficients[0] == pytest.approx(plain.coefficients[0], abs=0.02)
    assert plain.level == pytest.approx(1.0, abs=0.03)


def test_missing_readings_count_for_nothing_and_few_say_nothing():
    parts = noise(2)
    parts[2, 330:334] += BEAT
    parts[2, 331:333] = np.nan
    assert np.isfinite(scan_of(parts).chance)
    assert scan_of(np.full((PARTS, ROWS), np.nan)) == NO_EXCESS
    assert scan_statistic([np.ones(60)], [[0, 30, 60]], 1.0, 0.0) == NO_EXCESS
    assert scan_statistic([100.0 * np.ones(200)], [[0, 200]], 1.0, 0.0) == NO_EXCESS


def test_autocorrelation_is_that_of_the_noise():
    weights = (0.6, -0.3, 0.1)
    drawn = lfilter(
        [1.0], [1.0, *(-w for w in weights)], np.random.default_rng(0).normal(size=400000)
    )
    shares = [drawn[: len(drawn) - k] @ drawn[k:] / (drawn @ drawn) for k in range(8)]
    colour = autocorrelation(Whitening(weights, 1.0, 1.0), 8)
    assert np.allclose(colour, shares, atol=0.01)
    assert np.array_equal(autocorrelation(Whitening((), 1.0, 1.0), 3), [1.0, 0.0, 0.0])


RATE = 128.0


@pytest.mark.parametrize("coefficient", [0.0, 0.5])
def test_noise_with_a_short_memory_is_never_sure(coefficient):
    for seed in range(60):
        result = autocorrelation_test(noise(seed, coefficient), RATE)
        assert not result.sure
        assert result.score < 5.5
        assert result.variance == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("hertz", [0.4, 2.0, 7.0])
def test_a_sine_as_large_as_half_the_noise_is_seen_at_its_size(hertz):
    time = np.arange(ROWS) / RATE
    parts = [part + np.sqrt(0.5) * np.sin(2 * np.pi * hertz * time + k)
             for k, part in enumerate(noise(1))]  # fmt: skip
    result = autocorrelation_test(parts, RATE)
    assert result.sure
    # Its autocorrelation is its share of the variance, at a lag of whole or half periods.
    assert result.share == pytest.approx(0.25 / 1.25, abs=0.05)


def test_missing_readings_count_for_nothing():
    parts = noise(2)
    whole = autocorrelation_test(parts, RATE)
    torn = [np.where(np.arange(ROWS) % 3 == 0, np.nan, part) for part in parts]
    result = autocorrelation_test(torn, RATE)
    assert result.variance == pytest.approx(whole.variance, abs=0.05)
    assert not result.sure


def test_few_readings_say_nothing():
    result = autocorrelation_test([np.ones(50)], RATE)
    assert (result.share, result.score, result.sure) == (0.0, 0.0, False)


@pytest.mark.parametrize("hertz", [1.0, 7.0])
def test_a_ringing_residual_has_its_tone(hertz):
    time = np.arange(ROWS) / RATE
    parts = [
        part + 0.8 * np.sin(2 * np.pi * hertz * time + k) for k, part in enumerate(noise(1, 0.5))
    ]
    beat = tone(parts, RATE)
    assert beat is not None
    assert beat.hertz == pytest.approx(hertz, abs=0.15)
    assert beat.rms == pytest.approx(0.8 / np.sqrt(2.0), rel=0.15)


def test_noise_and_a_slow_drift_have_no_tone():
    time = np.arange(ROWS) / RATE
    assert all(tone(noise(seed, 0.5), RATE) is None for seed in range(20))
    assert tone([part + np.exp(-time / 2.0) for part in noise(1)], RATE) is None


def test_one_swing_in_each_piece_is_no_tone():
    """Pieces of a second that each begin anew leave a swing a second, whatever is missing."""
    rng, rate = np.random.default_rng(3), 100.0
    time = np.arange(100) / rate
    parts = [
        np.sin(2.0 * np.pi * time + rng.uniform(0.0, 6.0)) + 0.1 * rng.standard_normal(100)
        for _ in range(40)
    ]
    assert autocorrelation_test(parts, rate).sure
    assert tone(parts, rate) is None
    longer = [np.concatenate([part, part, part]) for part in parts]
    swing = tone(longer, rate)
    assert swing is not None and swing.hertz == pytest.approx(1.0, abs=0.2)
