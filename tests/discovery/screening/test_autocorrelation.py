"""What a residual remembers of itself: nothing if it is noise, what was put in if it is not."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pma_gym.discovery.screening.autocorrelation import autocorrelation_test, tone

RATE = 128.0
ROWS = 1024


def noise(seed, memory_=0.0, parts=6):
    """Noise of variance 1 that follows itself by one coefficient."""
    generator = np.random.default_rng(seed)
    white = generator.standard_normal((parts, ROWS + 200))
    coloured = lfilter([np.sqrt(1 - memory_**2)], [1, -memory_], white, axis=1)
    return list(np.asarray(coloured)[:, 200:])


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
