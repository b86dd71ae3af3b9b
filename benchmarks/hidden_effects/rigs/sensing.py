"""A position sensor: noise and the step that it rounds to."""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.rigs.rig import Rig, log_uniform

Array = np.ndarray


@dataclass(frozen=True)
class Noise:
    """Noise of one sensor, in its unit.

    Attributes:
        white: standard deviation of what is new in every reading.
        hum: rms of mains hum.
        mains: its frequency (Hz).
        harmonics: amplitude of the second and third harmonic over the first.
        drift: rms of what changes over minutes.
        colour: standard deviation of an autoregression of order 1.
        memory: time in which that falls to 1/e (s).
        outlier_share: share of readings that are outliers.
        outlier_size: their size over `white`.
        tails: degrees of freedom of Student's t in place of a Gaussian; 0 for a Gaussian.
    """

    white: float
    hum: float = 0.0
    mains: float = 50.0
    harmonics: tuple[float, float] = (0.0, 0.0)
    drift: float = 0.0
    colour: float = 0.0
    memory: float = 0.01
    outlier_share: float = 0.0
    outlier_size: float = 10.0
    tails: float = 0.0
    names: tuple[str, ...] = field(default=())

    @property
    def rms(self) -> float:
        """Of all but the outliers."""
        return math.sqrt(self.white**2 + self.hum**2 + self.drift**2 + self.colour**2)

    def draw(self, rng: np.random.Generator, time: Array) -> Array:
        """Noise at some instants (s), shape (rows,)."""
        rows = len(time)
        if self.tails:
            spread = math.sqrt(self.tails / (self.tails - 2.0))
            noise = self.white * rng.standard_t(self.tails, rows) / spread
        else:
            noise = self.white * rng.standard_normal(rows)
        noise += self._humming(rng, time) + self._drifting(rng, time) + self._coloured(rng, time)
        is_outlier = rng.random(rows) < self.outlier_share
        sizes = self.white * self.outlier_size * rng.choice((-1.0, 1.0), rows)
        return noise + np.where(is_outlier, sizes * rng.uniform(0.6, 1.4, rows), 0.0)

    def _humming(self, rng: np.random.Generator, time: Array) -> Array:
        shape = np.array([1.0, *self.harmonics])
        shape *= self.hum * math.sqrt(2.0) / math.sqrt(float(shape @ shape))
        phases = rng.uniform(0.0, 2.0 * math.pi, len(shape))
        # The net is never at its nominal frequency.
        mains = self.mains * (1.0 + 2e-4 * rng.standard_normal())
        angles = 2.0 * math.pi * mains * time[:, None] * np.arange(1, len(shape) + 1)
        return np.sin(angles + phases) @ shape

    def _drifting(self, rng: np.random.Generator, time: Array) -> Array:
        """Half a wave to one and a half over the file, from 0 at its start."""
        turns, phase = rng.uniform(0.5, 1.5), rng.uniform(0.0, 2.0 * math.pi)
        wave = np.sin(2.0 * math.pi * turns * time / max(float(time[-1]), 1e-9) + phase)
        return self.drift * wave / max(float(np.std(wave)), 1e-9)

    def _coloured(self, rng: np.random.Generator, time: Array) -> Array:
        keep = math.exp(-float(np.median(np.diff(time))) / self.memory)
        new = math.sqrt(1.0 - keep * keep) * rng.standard_normal(len(time))
        new[0] /= math.sqrt(1.0 - keep * keep)
        return self.colour * np.asarray(lfilter([1.0], [1.0, -keep], new))


def draw_noise(rng: np.random.Generator, white: float) -> Noise:
    """White noise of a sensor, alone in two of five cases, else with one or two of the others."""
    count = int(rng.choice((0, 1, 2), p=(0.4, 0.4, 0.2)))
    names = tuple(rng.choice(("hum", "drift", "colour", "outliers", "tails"), count, replace=False))
    options: dict[str, float | tuple[float, float]] = {}
    if "hum" in names:
        options["hum"] = white * rng.uniform(0.3, 0.8)
        options["mains"] = float(rng.choice((50.0, 60.0)))
        options["harmonics"] = (rng.uniform(0.0, 0.3), rng.uniform(0.0, 0.6))
    if "drift" in names:
        options["drift"] = white * rng.uniform(0.3, 0.8)
    if "colour" in names:
        options["colour"] = white * rng.uniform(0.4, 1.2)
        options["memory"] = rng.uniform(0.005, 0.05)
    if "outliers" in names:
        options["outlier_share"] = rng.uniform(2e-4, 3e-3)
        options["outlier_size"] = rng.uniform(6.0, 20.0)
    if "tails" in names:
        options["tails"] = rng.uniform(3.0, 5.0)
    return Noise(white, names=tuple(str(name) for name in names), **options)  # pyright: ignore[reportArgumentType]


@dataclass(frozen=True)
class Sensor:
    """Sensor of a position.

    Attributes:
        kind: `encoder` or `potentiometer`.
        step: that readings are rounded to (m, rad).
        noise: before that.
    """

    kind: str
    step: float
    noise: Noise

    @property
    def rms(self) -> float:
        """Of noise and rounding (m, rad)."""
        return float(np.hypot(self.noise.rms, self.step / np.sqrt(12.0)))

    def reading(self, q: float, noise: float) -> float:
        """What it shows at a position (m, rad), with so much noise."""
        return self.step * round((q + noise) / self.step)


def draw_sensor(rng: np.random.Generator, rig: Rig) -> Sensor:
    """Encoders of 50 nm to a five-hundredth of the travel; potentiometers of 12 to 16 bit."""
    if rng.random() < 0.6:
        most = rig.travel / 500.0
        step = log_uniform(rng, max(50e-9 if rig.kind == "slide" else 6e-6, most / 1000.0), most)
        return Sensor("encoder", step, draw_noise(rng, step * rng.uniform(0.15, 1.0)))
    low, high = (0.3e-3, 2e-3) if rig.kind == "slide" else (1e-3, 5e-3)
    white = max(rig.travel, 0.3 if rig.kind == "joint" else 0.0) * log_uniform(rng, low, high)
    step = 2.5 * rig.travel / 2 ** int(rng.integers(12, 17))
    return Sensor("potentiometer", step, draw_noise(rng, white))
