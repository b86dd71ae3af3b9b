"""Ideal motion of a task, phase by phase; the two tasks of the dissertation."""

import copy
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.data.signals import SIGNALS, Signal
from pma_gym.metrics import PHASE_DURATION, PHASE_SAMPLES, SAMPLE_RATE_HZ
from pma_gym.pickling import Packed, packed
from pma_gym.units import SI_FACTORS

_MM = SI_FACTORS["mm"]
_DEG = SI_FACTORS["deg"]

Motion = Callable[[Any], Any]
"""Ideal position (m or rad) by time since the start of the trial (s): of an array one of the same
shape, of a number one."""

Followed = Literal["extension", "rotation", "contraction", "excess"]
"""What a task asks for, from where the trial began: how far the muscle is pulled out (m), how far
the pulley has turned (rad), or how far the muscle has shortened (m); or by how much the moment at a
joint exceeds the one that is prescribed at its angle (N m), which is to be 0."""

OVERTIME = PHASE_SAMPLES - round(PHASE_DURATION * SAMPLE_RATE_HZ)
"""Samples of a phase beyond those of its duration, as in the dissertation's tables: the first and
two more."""


@dataclass(frozen=True)
class Phase:
    """A part of a task that is scored on its own: one ideal speed, or a piece of a motion.

    Attributes:
        name: as the dissertation's tables call it.
        start: when it begins, from the start of the trial (s).
        duration: how long it lasts (s).
        initial: ideal position at its start (m or rad).
        slope: ideal speed (m/s or rad/s); of a motion, the mean one.
        motion: ideal position by the trial's time, the same function for all phases of a schedule;
            None where it is the line of `initial` and `slope`.
    """

    name: str
    start: float
    duration: float
    initial: float
    slope: float
    motion: Motion | None = None

    def reference(self, time: ArrayLike) -> NDArray[np.float64]:
        """Ideal position at times on the phase's own clock, as a line or a motion without end.

        A phase is scored 5 ms past its duration (`metrics.phase_times`), on this.

        Args:
            time: time since the start of the phase (s), any shape.
        Returns:
            Position (m or rad), same shape.
        """
        own = np.asarray(time, dtype=np.float64)
        if self.motion is not None:
            return self.motion(self.start + own)
        return self.initial + self.slope * own

    @property
    def first(self) -> int:
        """Number of its first sample at 384 Hz."""
        return round(self.start * SAMPLE_RATE_HZ)

    @property
    def samples(self) -> int:
        """Number of samples at which it is scored.

        >>> DISPLACEMENT.phases[0].samples
        1923
        """
        return round(self.duration * SAMPLE_RATE_HZ) + OVERTIME

    @property
    def times(self) -> NDArray[np.float64]:
        """Times at which it is scored, on the phase's clock (s), shape (samples,)."""
        return np.arange(self.samples) / SAMPLE_RATE_HZ


@dataclass(frozen=True)
class TrialSchedule:
    """What a trial asks for: the quantity that follows a reference, phase by phase.

    Attributes:
        name: how the task is called.
        quantity: what is to follow: as above, or a signal that a rig measures.
        unit: the quantity's unit where people read it.
        span: range that an error is given in percent of (m or rad): what the reference covers, or
            may cover.
        phases: in order, each beginning where the one before ends.
    """

    name: str
    quantity: Followed | str
    unit: str
    span: float
    phases: tuple[Phase, ...]

    def __post_init__(self) -> None:
        """Refuse phases that do not follow each other, and two motions at once."""
        end = 0.0
        for phase in self.phases:
            if abs(phase.start - end) > 1e-9 or not 0.0 < phase.duration < float("inf"):
                raise ValueError(
                    f"phase {phase.name} of {self.name} must begin where the one before ends, at "
                    f"{end:g} s, and last a positive time, got {phase.start:g} s and "
                    f"{phase.duration:g} s"
                )
            end = phase.start + phase.duration
        if len({phase.motion for phase in self.phases}) != 1:
            raise ValueError(
                f"phases of {self.name} must be one or more, all lines or all of one motion; write "
                "it as one function of the trial's time"
            )

    def __getstate__(self) -> dict[str, Any]:
        """Its fields for pickle, the motion once for all phases: it may be any function."""
        if self.motion is None:
            return vars(self)
        phases = tuple(replace(phase, motion=None) for phase in self.phases)
        motion = packed(f"the motion of {self.name}", self.motion)
        return vars(self) | {"phases": phases, "motion": motion}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Take what `__getstate__` gave."""
        attributes = dict(state)
        motion = attributes.pop("motion", None)
        if isinstance(motion, Packed):
            function: Any = motion.value()
            attributes["phases"] = tuple(
                replace(phase, motion=function) for phase in attributes["phases"]
            )
        self.__dict__.update(attributes)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """A copy with phases of its own: whoever overwrites those by force changes no other trial.

        A motion of the user's own that cannot be copied is shared.
        """
        motion = self.motion
        with suppress(Exception):
            motion = copy.deepcopy(motion, memo)
        other = replace(self, phases=tuple(replace(each, motion=motion) for each in self.phases))
        memo[id(self)] = other
        return other

    @property
    def followed(self) -> Signal:
        """The signal of its quantity."""
        return SIGNALS[self.quantity]

    @property
    def suffix(self) -> str:
        """The unit as it ends a name: `mm`, `deg`, `nm` for N m."""
        return self.unit.replace(" ", "").lower()

    @property
    def motion(self) -> Motion | None:
        """The motion that the phases are pieces of; None where they are lines."""
        return self.phases[0].motion

    @property
    def duration(self) -> float:
        """Time at which the last phase ends (s)."""
        last = self.phases[-1]
        return last.start + last.duration

    def reference(self, time: ArrayLike) -> NDArray[np.float64]:
        """Ideal position at any time of the trial.

        Args:
            time: time since the start of the trial (s), any shape.
        Returns:
            Position (m or rad), same shape; held at its ends before the start and after the end.
        """
        if self.motion is not None:
            own = np.asarray(time, dtype=np.float64)
            return np.asarray(self.motion(np.clip(own, 0.0, self.duration)), dtype=np.float64)
        last = self.phases[-1]
        times = [*(phase.start for phase in self.phases), self.duration]
        positions = [*(phase.initial for phase in self.phases), last.reference(last.duration)]
        return np.asarray(np.interp(np.asarray(time, dtype=np.float64), times, positions))

    def at(self, time: float) -> float:
        """Ideal position (m or rad) at one time (s), as `reference`; faster."""
        if self.motion is not None:
            return float(self.motion(min(max(float(time), 0.0), self.duration)))
        return float(self.reference(time))


DISPLACEMENT = TrialSchedule(
    name="displacement",
    quantity="extension",
    unit="mm",
    span=25 * _MM,
    phases=(Phase("displacement", 0.0, PHASE_DURATION, initial=0.0, slope=5 * _MM),),
)
"""Isokinetic displacement: y = 5 mm/s * t for 5 s (Serres 2008, section 4.2.3, tables 20-22)."""

ROTATION = TrialSchedule(
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

SCHEDULES = {schedule.name: schedule for schedule in (DISPLACEMENT, ROTATION)}
"""The dissertation's two by name."""
