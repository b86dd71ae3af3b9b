"""A part on a testing machine: a seal under pressure, a brake, a spring."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from benchmarks.hidden_effects.rigs.rig import RATES, log_uniform

SLOWEST_HZ = 5.0
"""Bandwidth of the slowest machines."""


@dataclass(frozen=True)
class ImposedRig:
    """A part that another drive moves, and whose force is measured.

        force = mass q'' + damping q' + stiffness q + area pressure

    Attributes:
        kind: `imposed`.
        mass: that moves beyond the load cell (kg).
        damping: viscous (N s/m).
        stiffness: (N/m); 0 without.
        area: that pressure acts on (m^2); 0 without.
        pressures: of each file (Pa).
        travel: half of the stroke (m).
        frequency: fastest of the motion (Hz).
        rate: of the log (Hz).
    """

    kind: str
    mass: float
    damping: float
    stiffness: float
    area: float
    pressures: tuple[float, ...]
    travel: float
    frequency: float
    rate: float

    gravity: ClassVar[float] = 0.0

    @property
    def bandwidth(self) -> float:
        """Of the machine (Hz): it turns within a tenth of a second, or of its fastest period."""
        return min(max(SLOWEST_HZ, 8.0 * self.frequency), self.rate / 10.0)

    @property
    def peak_speed(self) -> float:
        """Of a sine over the whole stroke (m/s)."""
        return 2.0 * math.pi * self.frequency * self.travel

    @property
    def peak_force(self) -> float:
        """Change of the force over such a sine, all parts added up (N)."""
        omega = 2.0 * math.pi * self.frequency
        moving = (self.mass * omega + self.damping) * omega * self.travel
        return moving + self.stiffness * self.travel + 0.05 * self.area * max(self.pressures)


def draw_imposed(rng: np.random.Generator, files: int) -> ImposedRig:
    """A seal under pressure, a brake or a spring on a testing machine: strokes of 1 mm to 1 m."""
    travel = log_uniform(rng, 0.5e-3, 0.5)
    # Testing machines are slow.
    frequency = min(log_uniform(rng, 0.1, 2.0), 0.5 / travel / 2.0 / math.pi)
    scale = log_uniform(rng, 1.0, 3000.0)
    area, stiffness, pressures = 0.0, 0.0, (0.0,) * files
    shape = str(rng.choice(("seal", "brake", "spring")))
    if shape == "seal":
        area = scale / 4e5
        pressures = tuple(float(round(1e5 * rng.uniform(1.0, 7.0), -3)) for _ in range(files))
    elif shape == "spring":
        stiffness = scale / travel
    damping = scale * rng.uniform(0.05, 0.3) / (2.0 * math.pi * frequency * travel)
    mass = log_uniform(rng, 0.05, 20.0)
    rates = [rate for rate in RATES if rate >= 100.0 * frequency and rate <= 1000.0]
    rate = float(rng.choice(rates))
    return ImposedRig("imposed", mass, damping, stiffness, area, pressures, travel, frequency, rate)
