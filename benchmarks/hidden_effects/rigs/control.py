"""A lab's controllers: forces computed beforehand, or a loop closed over the sensor."""

import math
from dataclasses import dataclass

from benchmarks.hidden_effects.rigs.excitation import Reference
from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.sensing import Sensed

BITS = 16
"""Of the converter that commands go through."""

REACH = 4.0
"""Commands end at so many times the peak force of the axis."""


@dataclass
class Controller:
    """Source of commands for a simulation, which also reads the sensor of every row.

    Attributes:
        believed: the rig as the lab's model has it.
        reference: to follow.
        sensed: its sensor.
        bandwidth: of the closed loop (Hz); 0 leaves it open.
        released: the loop closes at the end of the rest; else it holds the axis there too.
    """

    believed: Rig
    reference: Reference
    sensed: Sensed
    bandwidth: float
    released: bool

    def __post_init__(self) -> None:
        self.readings: list[float] = []
        self.limit = REACH * self.believed.peak_force
        self.step = 2.0 * self.limit / 2**BITS
        self._slope = 0.0
        moving = self.reference.q != self.reference.q[0]
        self._closed_from = int(moving.argmax()) if self.released else 1

    def __call__(self, row: int, q: float) -> float:
        """Command of a row; q is the position in the row before it."""
        if row:
            self.readings.append(self.sensed.read(q))
        force = self._forward(row)
        if self.bandwidth and row >= self._closed_from:
            force += self._feedback(row)
        return self.step * round(min(max(force, -self.limit), self.limit) / self.step)

    def end(self, q: float) -> None:
        """The reading of the last row."""
        self.readings.append(self.sensed.read(q))

    def _forward(self, row: int) -> float:
        rig, to = self.believed, self.reference
        force = rig.inertia * to.a[row] + rig.damping * to.v[row] + rig.stiffness * to.q[row]
        return float(force + rig.gravity * math.sin(to.q[row] + rig.gravity_angle))

    def _feedback(self, row: int) -> float:
        """Position and filtered speed; the reading is a row old."""
        omega, inertia = 2.0 * math.pi * self.bandwidth, self.believed.inertia
        interval = self.sensed.interval
        error = self.reference.q[row - 1] - self.readings[-1]
        if len(self.readings) > 1:
            new = (self.readings[-1] - self.readings[-2]) / interval
            keep = math.exp(-5.0 * omega * interval)
            self._slope = keep * self._slope + (1.0 - keep) * new
        slow = self.reference.v[row - 1] - self._slope
        return inertia * omega * (omega * error + 1.4 * slow)
