"""Effects that no catalogue has."""

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.physics.rig import BANDWIDTH, UNITS, Array, Hidden, Moment, daq_steps


class SlowSensor(Hidden):
    """A sensor takes longer (s) than its data sheet says."""

    def __init__(self, signal: int, longer: Array) -> None:
        """Take which signal, and times of all lanes."""
        self.signal, self.longer = signal, longer

    def bandwidths(self, bandwidths: Array) -> Array:
        """Bandwidths, one of them lower."""
        out = bandwidths.copy()
        time = 1.0 / (2.0 * np.pi * BANDWIDTH[self.signal]) + self.longer
        out[self.signal] = 1.0 / (2.0 * np.pi * time)
        return out


class CoarseSensor(Hidden):
    """A converter has lost its last bits: one sensor comes in whole multiples of the DAQ's step."""

    def __init__(self, signal: int, steps: Array) -> None:
        """Take which signal, and how many steps of all lanes; 0 leaves it alone."""
        self.signal, self.steps = signal, steps

    def shown(self, readings: Array) -> Array:
        """Readings, one of them rounded."""
        out, size = readings.copy(), self.steps[:, None] * daq_steps(self.signal)
        fine = np.maximum(size * UNITS[self.signal], 1e-12)
        rounded = np.round(out[..., self.signal] / fine) * fine
        out[..., self.signal] = np.where(size > 0.0, rounded, out[..., self.signal])
        return out


class LooseSensor(Hidden):
    """The potentiometer's shaft has play (rad)."""

    def __init__(self, play: Array) -> None:
        """Take full play of all lanes."""
        self.half, self.at = 0.5 * play, np.zeros(0)

    def begin(self, moment: Moment) -> None:
        """The shaft stands in the middle of its play."""
        self.at = moment.angle.copy()

    def sensed(self, signals: list[Array], step: float) -> list[Array]:
        """The shaft goes along only once its play is used up."""
        turned = signals[1]
        out = np.empty_like(turned)
        for n in range(len(turned)):
            self.at = np.clip(self.at, turned[n] - self.half, turned[n] + self.half)
            out[n] = self.at
        return [signals[0], out, *signals[2:]]


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


class TiltedLoadCell(Hidden):
    """The load cell's gain grows with contraction, for the cable pulls at another angle."""

    def __init__(self, share: Array) -> None:
        """Take the change of gain a metre of contraction, of all lanes."""
        self.share, self.rest = share, np.zeros(0)

    def begin(self, moment: Moment) -> None:
        """Calibrated where the trial begins with no load."""
        self.rest = moment.resting.copy()

    def sensed(self, signals: list[Array], step: float) -> list[Array]:
        """Signals, the load with its contraction's gain."""
        rest = self.rest if self.rest.size else signals[0][0]
        gain = 1.0 + self.share * (signals[0] - rest)
        return [signals[0], signals[1], gain * signals[2], signals[3]]


class EccentricPotentiometer(Hidden):
    """The potentiometer's disc turns about a point beside its centre: an error once a turn."""

    def __init__(self, height: Array, phase: float) -> None:
        """Take errors (rad) of all lanes, and the phase (rad)."""
        self.height, self.phase = height, phase

    def sensed(self, signals: list[Array], step: float) -> list[Array]:
        """Signals, the angle with its error."""
        error = self.height * np.sin(2.0 * signals[1] + self.phase)
        return [signals[0], signals[1] + error, *signals[2:]]


class CompressorBeat(Hidden):
    """The supply's pressure swings as the compressor runs, and the regulator passes it on."""

    def __init__(self, height: Array, hertz: float) -> None:
        """Take swings (Pa) of all lanes, and their frequency (Hz)."""
        self.height, self.hertz, self.passed = height, hertz, 0

    def pressures(self, asked: Array, step: float) -> Array:
        """Pressures asked for, and the swing, which begins with the trial."""
        if step == 0.0:
            self.passed = 0
            return asked
        times = step * (self.passed + np.arange(len(asked)))
        self.passed += len(asked)
        return asked + np.sin(2.0 * np.pi * self.hertz * times)[:, None] * self.height


class BowedDrive(Hidden):
    """The drive's load bends away from the straight line, as of a magnet near saturation."""

    def __init__(self, bow: Array, most: float) -> None:
        """Take the bow (N) of all lanes in the middle, and the load (N) where the line ends."""
        self.bow, self.most = bow, most

    def loads(self, loads: Array, step: float) -> Array:
        """Loads, one and a half waves beside the line."""
        return loads + self.bow * np.sin(3.0 * np.pi * loads / self.most)
