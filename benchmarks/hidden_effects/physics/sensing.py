"""Hidden effects of sensors."""

import numpy as np

from benchmarks.hidden_effects.physics.effect import Hidden, Moment
from benchmarks.hidden_effects.physics.rig import BANDWIDTH, UNITS, Array, daq_steps


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
