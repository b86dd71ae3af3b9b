"""Noise as laboratories have it, beside that of the sensors: hum, drift, colour, outliers."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.physics.rig import Array

UGLY = ("hum", "drift", "coloured", "outliers")
"""What may stand in the readings."""

SIZES = {"hum": (0.5, 1.4), "drift": (0.4, 0.8), "coloured": (0.6, 0.8), "outliers": (0.002, 0.01)}
"""Ranges of sizes: rms in standard deviations of the noise (hum, drift), correlation from reading
to reading in one sensor (coloured), share of readings (outliers)."""

SPIKE = (5.0, 15.0)
"""Range of an outlier, in standard deviations."""

MAINS_OFF_HZ = 0.03
"""Standard deviation of the frequency of mains (Hz)."""


@dataclass(frozen=True)
class ReadoutNoise:
    """Disturbances of a case's readings beside its sensors' noise.

    Attributes:
        kind: one of `UGLY`, or empty: nothing.
        size: see `SIZES`; of the four signals.
        hertz: of mains.
    """

    kind: str = ""
    size: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    hertz: float = 50.0

    def memory(self, signal: int, usual: float) -> float:
        """Correlation of a signal's noise from reading to reading."""
        return self.size[signal] if self.kind == "coloured" and self.size[signal] else usual

    def added(self, g: np.random.Generator, time: Array) -> Array:
        """Of one trial, in standard deviations of the noise, shape (rows, 4)."""
        out = np.zeros((len(time), 4))
        for signal, size in enumerate(self.size):
            if self.kind == "hum":
                angle = 2.0 * np.pi * self.hertz * time + g.uniform(0.0, 2.0 * np.pi)
                out[:, signal] = np.sqrt(2.0) * size * np.sin(angle)
            elif self.kind == "drift":
                out[:, signal] = size * _walk(g, len(time))
            elif self.kind == "outliers":
                there = g.uniform(size=len(time)) < size
                spikes = g.choice([-1.0, 1.0], len(time)) * g.uniform(*SPIKE, len(time))
                out[:, signal] = np.where(there, spikes, 0.0)
        return out

    def describe(self) -> Mapping[str, object]:
        """For the truth."""
        return {"kind": self.kind, "size": list(self.size), "hertz": self.hertz}


NONE = ReadoutNoise()


def draw_noise(g: np.random.Generator, kind: str) -> ReadoutNoise:
    """Noise of a kind; hum is 50 or 60 Hz in all sensors, colour is in one."""
    if not kind:
        return NONE
    size = float(g.uniform(*SIZES[kind]))
    hertz = float(g.choice([50.0, 60.0]) + MAINS_OFF_HZ * g.standard_normal())
    sizes = [size] * 4
    if kind == "coloured":
        sizes = [0.0] * 4
        sizes[int(g.integers(4))] = size
    return ReadoutNoise(kind, tuple(sizes), hertz)


def _walk(g: np.random.Generator, rows: int) -> Array:
    """A slow walk of mean square 1 about its mean: integrated white noise, another every time."""
    walk = np.cumsum(g.standard_normal(rows))
    # Smooth: a sensor warms up and cools down over seconds.
    at = np.arange(rows) / rows
    waves = [np.cos(np.pi * k * at) for k in (1, 2)]
    walk = sum(wave * float(wave @ walk) / float(wave @ wave) for wave in waves)
    walk = walk - np.mean(walk)
    return walk / np.sqrt(np.mean(walk**2))
