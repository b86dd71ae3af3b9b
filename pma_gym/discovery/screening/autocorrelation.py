"""Test the residual for autocorrelation beyond the correlation time of the noise.

The test needs no candidate. The noise of sensors is uncorrelated after some hundredths of a second;
what a wrong model leaves is correlated for longer, or oscillates. The largest autocorrelation
beyond that lag is compared with Bartlett's standard error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.thresholds import (
    CERTAIN,
    ENOUGH_FOR_NOISE,
    LEAST_AUTOCORRELATION,
    LONGEST_LAG_S,
    SLOW_S,
    TONE_HZ,
    TONE_PERIODS,
    TONE_SHARE,
    TONE_WIDTH,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AutocorrelationTest:
    """The largest autocorrelation of a signal's residual beyond that of noise.

    Attributes:
        share: largest autocorrelation, either sign, at lags that noise does not reach.
        score: the same in standard errors.
        variance: mean square of the residual (SI squared).
    """

    share: float
    score: float
    variance: float

    @property
    def sure(self) -> bool:
        """Whether it is more than chance, and large enough to matter."""
        return self.share > LEAST_AUTOCORRELATION and self.score > CERTAIN


def autocorrelation_test(parts: Sequence[Array], rate_hz: float) -> AutocorrelationTest:
    """Test the residual of one signal for autocorrelation beyond that of noise.

    Args:
        parts: of each trial (SI), NaN where there is none.
        rate_hz: readings a second.
    """
    series = [np.where(np.isfinite(part), part, 0.0) for part in parts]
    there = [np.isfinite(part).astype(float) for part in parts]
    first, last = max(1, round(SLOW_S[0] * rate_hz)), max(1, round(LONGEST_LAG_S * rate_hz))
    sums, counts = np.zeros(last + 1), np.zeros(last + 1)
    for values, known in zip(series, there, strict=True):
        for lag in range(min(last + 1, len(values))):
            size = len(values) - lag
            sums[lag] += values[:size] @ values[lag:]
            counts[lag] += known[:size] @ known[lag:]
    if counts[0] < ENOUGH_FOR_NOISE or sums[0] <= 0.0:
        return AutocorrelationTest(0.0, 0.0, 0.0)
    variance = sums[0] / counts[0]
    enough = counts >= 0.5 * ENOUGH_FOR_NOISE
    shares = np.where(enough, sums / np.maximum(counts, 1.0) / variance, 0.0)
    own = 1.0 + 2.0 * float(np.sum(shares[1:first] ** 2))
    scores = np.abs(shares[first:]) * np.sqrt(counts[first:] / own)
    return AutocorrelationTest(
        float(np.abs(shares[first:]).max()), float(scores.max()), float(variance)
    )


@dataclass(frozen=True)
class Tone:
    """A frequency at which a residual oscillates.

    Attributes:
        hertz: the frequency (Hz).
        rms: of what lies within a quarter of it, beyond the noise beside it (SI).
    """

    hertz: float
    rms: float


def tone(parts: Sequence[Array], rate_hz: float) -> Tone | None:
    """The frequency at which a residual oscillates; None where it is noise or has no peak.

    Args:
        parts: of each trial (SI), NaN where there is none.
        rate_hz: readings a second.
    """
    kept = autocorrelation_test(parts, rate_hz)
    if not kept.sure:
        return None
    size = max(len(part) for part in parts)
    count = sum(int(np.isfinite(part).sum()) for part in parts)
    power = np.zeros(size // 2 + 1)
    for part in parts:
        power += np.abs(np.fft.rfft(np.where(np.isfinite(part), part, 0.0), size)) ** 2
    power *= 2.0 / size / count
    hertz = np.arange(len(power)) * rate_hz / size
    slowest = max(TONE_HZ, TONE_PERIODS * rate_hz / size)
    peak = int(np.argmax(np.where(hertz < slowest, 0.0, power)))
    away = np.abs(hertz - hertz[peak])
    near = away < TONE_WIDTH * hertz[peak]
    # Noise with a memory is not of one level; about the peak it nearly is.
    floor = np.median(power[away < max(2.0 * TONE_WIDTH * hertz[peak], 4.0 * hertz[1])])
    inside = float(np.sum(power[near] - floor))
    if peak == 0 or inside < TONE_SHARE * kept.share * kept.variance:
        return None
    return Tone(float(hertz[peak]), float(np.sqrt(inside)))
