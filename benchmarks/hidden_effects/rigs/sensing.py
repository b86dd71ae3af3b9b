"""A position sensor: play, delay, noise and the step that it rounds to."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.hidden_effects.rigs.laws import SensorLink
from benchmarks.hidden_effects.rigs.noise import Noise, draw_noise
from benchmarks.hidden_effects.rigs.rig import Rig, log_uniform

Array = np.ndarray


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


@dataclass
class Sensed:
    """One sensor in one file: readings row by row.

    Attributes:
        sensor: which.
        noise: of every row, shape (rows,).
        between: axis and sensor, in the order in which they act.
        interval: between rows (s).
    """

    sensor: Sensor
    noise: Array
    between: Sequence[SensorLink]
    interval: float
    exact: list[float] = field(default_factory=list)
    _past: list[float] = field(default_factory=list)

    def read(self, q: float) -> float:
        """The next row's reading of a position."""
        row = len(self.exact)
        play, delay = (sum(getattr(r, key) for r in self.between) for key in ("play", "delay"))
        if row and play:
            before = self._past[-1]
            q = min(max(before, q - 0.5 * play), q + 0.5 * play)
        self._past.append(q)
        place = max(row - delay / self.interval, 0.0)
        first = int(place)
        part = place - first
        seen = self._past[first]
        if part:
            seen += part * (self._past[first + 1] - seen)
        self.exact.append(seen)
        step = self.sensor.step
        return step * round((seen + self.noise[row]) / step)


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
