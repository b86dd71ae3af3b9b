"""Effects that no catalogue has."""

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.physics.effect import Hidden, Moment
from benchmarks.hidden_effects.physics.rig import Array


class Bump(Hidden):
    """A force (N) at one contraction, as of a worn spot of the braid."""

    static = True

    def __init__(self, height: Array, at: float, width: float) -> None:
        """Take heights of all lanes, where it is and how wide (m)."""
        self.height, self.at, self.width = height, at, width

    def force(self, moment: Moment) -> Array:
        """Force at a contraction."""
        return self.height * np.exp(-0.5 * ((moment.contraction - self.at) / self.width) ** 2)


class Teeth(Hidden):
    """A force (N) periodic in contraction, as of a rack."""

    static = True

    def __init__(self, height: Array, period: float, phase: float) -> None:
        """Take heights of all lanes, period (m) and phase (rad)."""
        self.height, self.wave, self.phase = height, 2.0 * np.pi / period, phase

    def force(self, moment: Moment) -> Array:
        """Force at a contraction."""
        return self.height * np.cos(self.wave * moment.contraction + self.phase)


class Resonance(Hidden):
    """A lightly damped mass that is driven by one signal and shows in another."""

    def __init__(self, gain: Array, source: int, target: int, hertz: float, damping: float) -> None:
        """Take gains (SI of the target a SI of the source) of all lanes, and signals' numbers."""
        self.gain, self.source, self.target = gain, source, target
        self.frequency, self.ratio = 2.0 * np.pi * hertz, damping
        self.rest: Array = np.zeros(0)
        self.memory: Array = np.zeros((0, 0))

    def sensed(self, signals: list[Array], step: float) -> list[Array]:
        """The target, with the mass's motion beyond what it does at rest."""
        source = signals[self.source]
        if len(source) == 1:
            self.rest, self.memory = source[0].copy(), np.zeros((2, source.shape[1]))
            return signals
        w, z = self.frequency * step, self.ratio
        below = np.array([1.0, -2.0 * np.exp(-z * w) * np.cos(w), np.exp(-2.0 * z * w)])
        moved = source - self.rest
        follows, self.memory = lfilter([below.sum()], below, moved, 0, self.memory)
        out = list(signals)
        out[self.target] = out[self.target] + self.gain * (follows - moved)
        return out
