"""The two tasks of the dissertation: what the ideal motion is, phase by phase."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.metrics import PHASE_DURATION
from pma_gym.units import SI_FACTORS

_MM = SI_FACTORS["mm"]
_DEG = SI_FACTORS["deg"]


@dataclass(frozen=True)
class Phase:
    """A part of a task with one ideal speed, regressed and scored on its own.

    Attributes:
        name: as the dissertation's tables call it.
        start: when it begins, from the start of the trial (s).
        duration: how long it lasts (s).
        initial: ideal position at its start (m or rad).
        slope: ideal speed (m/s or rad/s).
    """

    name: str
    start: float
    duration: float
    initial: float
    slope: float

    def reference(self, time: ArrayLike) -> NDArray[np.float64]:
        """Ideal position at times on the phase's own clock, as a line without end.

        A phase is scored 5 ms past its duration (`metrics.phase_times`), on this line.

        Args:
            time: time since the start of the phase (s), any shape.
        Returns:
            Position (m or rad), same shape.
        """
        return self.initial + self.slope * np.asarray(time, dtype=np.float64)


@dataclass(frozen=True)
class Protocol:
    """A task: which quantity has to follow which reference.

    Attributes:
        name: how the task is called.
        quantity: what is to follow: extension (m) or rotation (rad), both from the trial's start.
        unit: the quantity's unit where people read it.
        span: range that the reference covers (m or rad); an RMSE is given in percent of it.
        phases: in order, each beginning where the one before ends.
    """

    name: str
    quantity: Literal["extension", "rotation"]
    unit: str
    span: float
    phases: tuple[Phase, ...]

    @property
    def duration(self) -> float:
        """When the last phase ends (s)."""
        last = self.phases[-1]
        return last.start + last.duration

    def reference(self, time: ArrayLike) -> NDArray[np.float64]:
        """Ideal position at any time of the trial.

        Args:
            time: time since the start of the trial (s), any shape.
        Returns:
            Position (m or rad), same shape; held at its ends before the start and after the end.
        """
        last = self.phases[-1]
        times = [*(phase.start for phase in self.phases), self.duration]
        positions = [*(phase.initial for phase in self.phases), last.reference(last.duration)]
        return np.asarray(np.interp(np.asarray(time, dtype=np.float64), times, positions))


DISPLACEMENT = Protocol(
    name="displacement",
    quantity="extension",
    unit="mm",
    span=25 * _MM,
    phases=(Phase("displacement", 0.0, PHASE_DURATION, initial=0.0, slope=5 * _MM),),
)
"""Isokinetic displacement: y = 5 mm/s * t for 5 s (Serres 2008, section 4.2.3, tables 20-22)."""

ROTATION = Protocol(
    name="rotation",
    quantity="rotation",
    unit="deg",
    span=90 * _DEG,
    phases=(
        Phase("I", 0.0, PHASE_DURATION, initial=0.0, slope=18 * _DEG),
        Phase("II", PHASE_DURATION, PHASE_DURATION, initial=90 * _DEG, slope=0.0),
        Phase("III", 2 * PHASE_DURATION, PHASE_DURATION, initial=90 * _DEG, slope=-18 * _DEG),
    ),
)
"""Isokinetic rotation: 0 to 90 deg in 5 s, 5 s there, back in 5 s (Serres 2008, section 4.3.1,
tables 24-30)."""

PROTOCOLS = {protocol.name: protocol for protocol in (DISPLACEMENT, ROTATION)}
"""The tasks by name."""
