"""The tone of a residual: none if it is noise, what was put in if it is not."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pma_gym.discovery.screening.autocorrelation import autocorrelation_test, tone

ROWS, PARTS = 1024, 6


def noise(seed, memory=0.0):
    """Noise of variance 1 that follows itself by one coefficient, shape (parts, rows)."""
    white = np.random.default_rng(seed).standard_normal((PARTS, ROWS + 100))
    return np.asarray(lfilter([np.sqrt(1 - memory**2)], [1, -memory], white, axis=1))[:, 100:]


RATE = 128.0


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
