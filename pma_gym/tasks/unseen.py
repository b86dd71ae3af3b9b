"""Unseen references: sines, sums of sines, steps and random speeds.

The motor follows those of extension and rotation at the pressures of the dissertation's trials, the
regulator those of contraction under a load. They last 10 s, lie within the ranges of the tasks
(25 mm, 90 deg, 12.5 mm of contraction) and begin at 0, and an error is given in percent of that
range, so that figures of all of them compare. Sines and their sums are faded in over 2.5 s, without
a jump of speed. But for the steps, which nothing follows, they are no faster than three times the
dissertation's own speed, 5 mm/s and 18 deg/s (a sum of sines up to five times while it is faded
in), and do not go back to where the muscle has no force left to pull the cable out;
`infeasibility_reason` says
what a station lacks for one.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

from pma_gym.data import motions
from pma_gym.data.trial_schedule import Motion, Phase, TrialSchedule
from pma_gym.tasks.isotonic import isotonic
from pma_gym.tasks.task import TASKS, Task
from pma_gym.units import SI_FACTORS

DURATION_S = 10.0
"""Duration of the unseen references (s)."""

RISE_S = 2.5
"""Duration of the sines' fade-in (s)."""

LOW, HIGH = 0.25, 0.95
"""Shares of the range that references stay within once they have risen: at 25 mm or 90 deg there is
no way on for an error, and near 0 the muscle hardly pulls."""

FASTEST = 0.6
"""Greatest speed (1/s): 15 mm/s or 54 deg/s, three times the dissertation's."""

SLOWEST = 0.1
"""Least speed of the random ones (1/s): 2.5 mm/s or 9 deg/s, half the dissertation's."""

FREQUENCIES_HZ = tuple(0.1 * k for k in range(1, 9))
"""Of a multisine: the first eight harmonics of the trial's length."""

_BASES = {
    "extension": TASKS["displacement"],
    "rotation": TASKS["rotation"],
    "contraction": isotonic(name="contraction"),
}
"""Task by quantity, whose range, pressures and load references have."""


def following(
    name: str,
    quantity: str,
    motion: Motion,
    duration: float = DURATION_S,
    span: float = 0.0,
    load: float | None = None,
) -> Task:
    """A task whose reference is any function of time, scored as one phase.

    The motor follows an extension or a rotation. The regulator follows a contraction, while the
    motor holds a load; the task begins at 150 to 350 kPa, as `isotonic` does, if
    `dataclasses.replace(task, start_pressures=(200e3, 300e3))` sets no other pressures (Pa).

    Args:
        name: name of the task.
        quantity: `extension`, `rotation` or `contraction`.
        motion: position (m or rad) by time since the start of the trial (s), of arrays and of
            numbers; 0 at time 0. To be sent to other processes it must be a function of a module
            or an object, no lambda.
        duration: how long (s).
        span: range that errors are given in percent of (m or rad); 25 mm, 90 deg or 12.5 mm of
            contraction if not given.
        load: load that the motor holds during a contraction (N); 200 N if not given.
    Raises:
        ValueError: another quantity, a motion that does not begin at 0 or is not finite, or a load
            where the motor moves.

    Example:
        >>> import numpy as np
        >>> slow = following("slow", "extension", lambda t: 2e-3 * np.square(t), duration=3.0)
        >>> slow.schedule.at(2.0), slow.steps(100.0)
        (0.008, 301)
    """
    base = _base(quantity)
    mean = (float(motion(duration)) - float(motion(0.0))) / duration
    phase = Phase("whole", 0.0, duration, float(motion(0.0)), mean, motion)
    own = base.schedule
    schedule = TrialSchedule(name, own.quantity, own.unit, span or own.span, (phase,))
    return replace(base, name=name, schedule=schedule, load=base.load if load is None else load)


def sine(
    quantity: str,
    mean: float | None = None,
    amplitude: float | None = None,
    frequency: float = 0.4,
    name: str = "",
) -> Task:
    """A sine about a mean position, beginning at its lowest.

        y = s(t) (mean - amplitude cos(2 pi frequency t)),   s fading in

    Args:
        quantity: `extension`, `rotation` or `contraction`.
        mean: mean position (m or rad); 0.5 of the range if not given, 12.5 mm, 45 deg or 6.25 mm.
        amplitude: amplitude (m or rad); 0.2 of the range if not given, 5 mm, 18 deg or 2.5 mm.
        frequency: frequency (Hz).
        name: name of the task; made of the numbers if not given.
    """
    span, unit = _span(quantity)
    mean = 0.5 * span if mean is None else mean
    amplitude = 0.2 * span if amplitude is None else amplitude
    tones = motions.Tones(mean, (amplitude,), (frequency,), (0.75,))
    width = f"{amplitude / SI_FACTORS[unit]:g}{unit}"
    name = name or f"{_BASES[quantity].name}_sine_{width}_{frequency:g}hz"
    return following(name, quantity, tones.ramped(RISE_S, DURATION_S))


def multisine(quantity: str, seed: int = 0, name: str = "") -> Task:
    """Eight sines of 0.1-0.8 Hz at random phases, of equal speeds, faded in.

    It fills 25 to 95 % of the range, or less where it would be faster than 15 mm/s or 54 deg/s.
    """
    span, _ = _span(quantity)
    tones = motions.multisine(FREQUENCIES_HZ, seed)
    scaled = tones.scaled(LOW * span, HIGH * span, FASTEST * span, DURATION_S)
    return _drawn("multisine", quantity, seed, name, scaled.ramped(RISE_S, DURATION_S))


def steps(quantity: str, seed: int = 0, name: str = "") -> Task:
    """Random positions in 25 to 95 % of the range, each held for 1 to 2 s; nothing follows it.

    The first step comes at 0.5 s; steps are of 10 to 30 % of the range.
    """
    span, _ = _span(quantity)
    sizes = 0.1 * span, 0.3 * span
    stairs = motions.levels(seed, LOW * span, HIGH * span, *sizes, DURATION_S)
    return _drawn("steps", quantity, seed, name, stairs)


def speeds(quantity: str, seed: int = 0, name: str = "") -> Task:
    """Isokinetic pieces of random speeds, 2.5-15 mm/s or 9-54 deg/s either way.

    The first leads up from 0; the others stay in 25 to 95 % of the range.
    """
    span, _ = _span(quantity)
    ranges = (LOW * span, HIGH * span, SLOWEST * span, FASTEST * span)
    return _drawn("speeds", quantity, seed, name, motions.ways(seed, *ranges, DURATION_S))


def _drawn(kind: str, quantity: str, seed: int, name: str, motion: Motion) -> Task:
    return following(name or f"{_BASES[quantity].name}_{kind}_{seed}", quantity, motion)


def _span(quantity: str) -> tuple[float, str]:
    schedule = _base(quantity).schedule
    return schedule.span, schedule.unit


def _base(quantity: str) -> Task:
    if quantity not in _BASES:
        raise ValueError(f"quantity must be one of {', '.join(_BASES)}, got {quantity!r}")
    return _BASES[quantity]


DRAWN: dict[str, Callable[..., Task]] = {"multisine": multisine, "steps": steps, "speeds": speeds}
"""What is drawn by a seed, by kind."""

SEEDS = 1_000_000
"""Seeds of tasks that are known by name: below this."""


def _all() -> dict[str, Task]:
    made = {}
    for base in TASKS.values():
        for kind, make in {"sine": sine, **DRAWN}.items():
            name = f"{base.name}_{kind}"
            made[name] = make(base.schedule.quantity, name=name)
    return made


UNSEEN: dict[str, Task] = _all()
"""One of each kind by name, such as `displacement_sine`; drawn ones of seed 0."""


@lru_cache(128)
def unseen(name: str) -> Task | None:
    """The drawn task of a name such as `rotation_steps_3` (of seed 3); None if it is no such name.

    >>> unseen("displacement_speeds_12").name, unseen("displacement_sine_1")
    ('displacement_speeds_12', None)
    """
    match = re.fullmatch(r"(displacement|rotation)_(multisine|steps|speeds)_(0|[1-9]\d*)", name)
    if match is None or int(match[3]) >= SEEDS:
        return None
    return DRAWN[match[2]](TASKS[match[1]].schedule.quantity, int(match[3]))
