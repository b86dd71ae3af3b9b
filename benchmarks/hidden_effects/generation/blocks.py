"""The blocks of the target table: what their cases hide, and how large.

Noise as laboratories have it, beside that of the sensors: hum, drift, colour, outliers.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.generation.cases import Case, draw_case
from benchmarks.hidden_effects.generation.effects import KINDS, OUTSIDE
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
                phase = g.uniform(0.0, 2.0 * np.pi)
                angle = 2.0 * np.pi * self.hertz * time + phase
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


@dataclass(frozen=True)
class Block:
    """Cases of one kind.

    Attributes:
        name: of the block.
        turns: effects that cases take turns in, so that each is hidden equally often; where empty,
            `draw_case` decides what is hidden.
        ratio: range of r, what an effect changes beyond a refit over the noise.
        trials: of a case.
        seconds: of a trial (s).
        rounds: experiments that follow on the same rig, where the diagnosis asks for one.
        ugly: what stands in the readings beside noise (`readout_noise`); empty: nothing.
    """

    name: str
    turns: tuple[str, ...] = ()
    ratio: tuple[float, float] = (0.5, 2.0)
    trials: int = 6
    seconds: float = 8.0
    rounds: int = 0
    ugly: str = ""

    def draw(self, seed: int, number: int) -> Case:
        """Case of a number, 1 and up; the same seed and number give the same bits."""
        hidden = (self.turns[(number - 1) % len(self.turns)],) if self.turns else None
        drawn = (self.trials, self.seconds, self.ratio, self.ugly)
        return draw_case(seed, number, self.name, hidden, *drawn)


BLOCKS: dict[str, Block] = {
    block.name: block
    for block in (
        Block("single", tuple(KINDS)),
        Block("faint", tuple(KINDS), (0.3, 0.3)),
        Block("nothing"),
        Block("parameters"),
        Block("pair"),
        Block("unknown", tuple(OUTSIDE)),
        *(Block(f"single_{ugly}", tuple(KINDS), ugly=ugly) for ugly in UGLY),
        *(Block(f"nothing_{ugly}", ugly=ugly) for ugly in UGLY),
        Block("slow_drift", ("creep", "leakage", "warm_up"), ugly="drift"),
    )
}
"""By name, in the order of the table."""
