"""Tasks of any rig: a reference for a signal that it measures, in the signal's own values (SI)."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pma_gym.data import motions
from pma_gym.data.signals import SIGNALS, Signal
from pma_gym.data.trial_schedule import Motion, Phase, TrialSchedule
from pma_gym.tasks.task import Task
from pma_gym.tasks.unseen import DURATION_S, FASTEST, FREQUENCIES_HZ, HIGH, LOW, RISE_S, SLOWEST

SPANS: dict[str, float] = {
    "displacement": 25e-3,
    "angle": np.pi / 2,
    "speed": 0.1,
    "angular speed": 2.0,
    "force": 100.0,
    "torque": 1.0,
    "pressure": 300e3,
}
"""Range of a reference where none is asked for (SI), by what a signal measures (assumption)."""


class TrackingTask(Task):
    """A reference for a measured signal; unlike a station's task it may begin anywhere."""

    def __post_init__(self) -> None:
        """Refuse a reference that is not finite."""
        phase = self.schedule.phases[0]
        if not np.all(np.isfinite(phase.reference(phase.times))):
            raise ValueError(f"task {self.name}: the reference must be finite throughout")


def tracking(
    signal: str,
    motion: Motion,
    span: float = 0.0,
    duration: float = DURATION_S,
    name: str = "",
) -> TrackingTask:
    """A task whose reference is any function of time, for a signal that a rig measures.

    Args:
        signal: what is to follow, such as `angle`, `speed`, `contraction` or `load`.
        motion: its value (SI) by time since the start of the trial (s), of arrays and of numbers.
            To be sent to other processes it must be a function of a module or an object.
        span: range that errors are in percent of (SI); 90 deg, 25 mm, 100 N, ... if not given.
        duration: how long (s).
        name: name of the task; that of the signal if not given.
    Raises:
        ValueError: no such signal, a range or duration that is not positive, or a reference that is
            not finite.

    Example:
        >>> swing = tracking("angle", lambda t: 0.5 * np.sin(3.0 * t), duration=4.0)
        >>> swing.schedule.unit, swing.steps(100.0)
        ('rad', 401)
    """
    known = [each.name for each in SIGNALS.values() if each.is_measured]
    if signal not in known:
        raise ValueError(f"signal must be one of {', '.join(known)}, got {signal!r}")
    span = span or SPANS[SIGNALS[signal].measures]
    if not 0.0 < span < float("inf"):
        raise ValueError(f"span must be positive, in {SIGNALS[signal].si_unit}, got {span!r}")
    phase = Phase("whole", 0.0, duration, float(motion(0.0)), 0.0, motion)
    name = name or signal
    schedule = TrialSchedule(name, signal, SIGNALS[signal].si_unit, span, (phase,))
    return TrackingTask(name, schedule, 0.0, 0.0)


def as_tracking(task: Task) -> TrackingTask:
    """Any task as a reference in SI for the signal of its name."""
    if isinstance(task, TrackingTask):
        return task
    schedule = replace(task.schedule, unit=task.schedule.followed.si_unit)
    return TrackingTask(task.name, schedule, 0.0, 0.0)


@dataclass(frozen=True)
class Shifted:
    """A motion from another start.

    Attributes:
        start: value at which it begins (SI).
        motion: the motion from 0 on.
    """

    start: float
    motion: Motion

    def __call__(self, time: Any) -> Any:  # noqa: ANN401
        """Value at one time or at many (s)."""
        return self.start + self.motion(time)


def _steps(span: float, duration: float, seed: int) -> Motion:
    return motions.levels(seed, LOW * span, HIGH * span, 0.1 * span, 0.3 * span, duration)


def _ramps(span: float, duration: float, seed: int) -> Motion:
    return motions.ways(seed, LOW * span, HIGH * span, SLOWEST * span, FASTEST * span, duration)


def _sine(span: float, duration: float, seed: int) -> Motion:
    return _swing(span, duration, 0.2 + 0.6 * float(motions.shares(seed, 3, 1)[0]) if seed else 0.4)


def _swing(span: float, duration: float, frequency: float) -> Motion:
    return motions.Tones(0.5 * span, (0.2 * span,), (frequency,), (0.75,)).ramped(RISE_S, duration)


def _multisine(span: float, duration: float, seed: int) -> Motion:
    tones = motions.multisine(FREQUENCIES_HZ, seed)
    scaled = tones.scaled(LOW * span, HIGH * span, FASTEST * span, duration)
    return scaled.ramped(RISE_S, duration)


KINDS: dict[str, Callable[[float, float, int], Motion]] = {
    "steps": _steps,
    "ramps": _ramps,
    "sine": _sine,
    "multisine": _multisine,
}
"""Motions from 0 on by kind: of a range (SI), a duration (s) and a seed."""

FASTEST_SINE_HZ = 10.0
"""Fastest sine of a name (Hz): knots of a motion are 1/64 s apart."""


def named_tracking(
    name: str,
    signals: Sequence[Signal],
    start: Callable[[str], float],
    span: float,
    duration: float,
) -> TrackingTask | None:
    """The task of a name such as `angle_steps_3`, of a signal, a kind and a seed; else None.

    `angle_sine_2hz` is a sine of 2 Hz, up to `FASTEST_SINE_HZ`; at 0 Hz it holds.

    Args:
        name: the name.
        signals: what the rig measures.
        start: value of a signal where an episode begins (SI).
        span: range of the reference (SI); 0 for the usual one of what the signal measures.
        duration: how long (s).
    """
    match = re.fullmatch(
        r"(.+)_(?:(steps|ramps|sine|multisine)(?:_(0|[1-9]\d{0,5}))?|sine_(\d{1,2}(?:\.\d+)?)hz)",
        name,
    )
    if match is None or match[1] not in [signal.name for signal in signals]:
        return None
    signal, kind, seed, frequency = match[1], match[2], int(match[3] or 0), float(match[4] or 0.0)
    if frequency > FASTEST_SINE_HZ:
        return None
    width = span or SPANS[SIGNALS[signal].measures]
    motion = KINDS[kind](width, duration, seed) if kind else _swing(width, duration, frequency)
    return tracking(signal, Shifted(start(signal), motion), width, duration, name)
