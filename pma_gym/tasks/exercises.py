"""Exercises as tasks: of one speed, of one moment, of a moment over the angle."""

import re
from collections.abc import Sequence

from pma_gym.data.trial_schedule import ROTATION, Phase, TrialSchedule
from pma_gym.tasks.exercise import PACE, SAFE_MOMENT, Exercise
from pma_gym.tasks.operator import PACED, PACING, moment_profile
from pma_gym.tasks.safety_filter import FILTER_PACED, FILTER_PACING
from pma_gym.tasks.task import TASKS, Task
from pma_gym.units import SI_FACTORS

_DEG = SI_FACTORS["deg"]
_KPA = SI_FACTORS["kPa"]


FARTHEST = 120.0 * _DEG
"""Largest angle of a prescription's knots (rad): beyond the straight leg there is nobody."""


def isokinetic_exercise(
    pressures: tuple[float, float] = (275 * _KPA, 575 * _KPA), name: str = "isokinetic_exercise"
) -> Task:
    """Hold the joint's speed.

    An episode begins at rest without a load, as the dissertation's rotation, at a pressure at which
    90 deg can be had: tables 23 and 30.

    Args:
        pressures: range of the pressures that episodes begin at (Pa).
        name: name of the task.
    """
    exercise = Exercise(None, PACED, FILTER_PACED)
    return Task(name, ROTATION, *pressures, "regulator", exercise=exercise)


def moment_exercise(
    angles: Sequence[float],
    moments: Sequence[float],
    start_pressures: tuple[float, float],
    name: str = "profile_exercise",
) -> Task:
    """Hold a moment, constant or over the angle.

    An episode begins at 0 deg, where the operator holds the first moment and the cable is drawn in
    so far that the muscle does at the episode's pressure.

    Args:
        angles: of the knots (rad), rising, the first 0; one for a constant moment.
        moments: there (N m), linear in between and constant beyond.
        start_pressures: range of the pressures that episodes begin at (Pa).
        name: name of the task.
    Raises:
        ValueError: a value breaks a rule; the message names the rule, the unit and the value.
    """
    angles, moments = [float(angle) for angle in angles], [float(moment) for moment in moments]
    _check_knots(angles, moments)
    phases = tuple(Phase(p.name, p.start, p.duration, 0.0, 0.0) for p in PACE.phases)
    schedule = TrialSchedule(name, "excess", "N m", max(moments), phases)
    lowest, highest = TASKS["displacement"].lowest_pressure, TASKS["displacement"].highest_pressure
    exercise = Exercise(moment_profile(angles, moments), PACING, FILTER_PACING)
    return Task(
        name,
        schedule,
        lowest,
        highest,
        "regulator",
        start_pressures=start_pressures,
        exercise=exercise,
    )


def isotonic_exercise(moment: float = 8.0, name: str = "isotonic_exercise") -> Task:
    """Hold one moment (N m) from 0 to 90 deg and back, beginning at 525 to 575 kPa."""
    return moment_exercise((0.0,), (moment,), (525 * _KPA, 575 * _KPA), name)


def _check_knots(angles: Sequence[float], moments: Sequence[float]) -> None:
    rule = "a prescription needs as many moments (N m) as angles (rad), one or more"
    if not angles or len(angles) != len(moments):
        raise ValueError(f"{rule}; got {len(moments)} moments and {len(angles)} angles")
    rising = all(a < b for a, b in zip(angles, angles[1:], strict=False))
    if angles[0] != 0.0 or not rising or not angles[-1] <= FARTHEST:
        raise ValueError(
            f"angles of a prescription must rise from 0 to {FARTHEST:.3g} rad at most (deg times "
            f"pi / 180), got {list(angles)}"
        )
    if not all(0.0 < moment < SAFE_MOMENT for moment in moments):
        raise ValueError(
            f"moments of a prescription must lie between 0 and the safe {SAFE_MOMENT:g} N m, got "
            f"{list(moments)}; `python -m benchmarks exercise` shows what a device gives"
        )


EXERCISES: dict[str, Task] = {
    task.name: task
    for task in (
        isokinetic_exercise(),
        isotonic_exercise(),
        moment_exercise(
            [0.0, 30 * _DEG, 60 * _DEG, 90 * _DEG], [4.0, 8.0, 9.0, 7.5], (450 * _KPA, 550 * _KPA)
        ),
    )
}
"""Exercises by name. The profile rises and falls as a knee's strength does, within what the tested
muscle gives with a cable set once."""


def numbered_exercise(name: str) -> Task | None:
    """The isotonic exercise of a moment by its name, `isotonic_exercise_6.5`; None if it is none.

    Raises:
        ValueError: a moment that is not safe.
    """
    match = re.fullmatch(r"isotonic_exercise_(\d+(?:\.\d+)?)", name)
    return isotonic_exercise(float(match[1]), name) if match else None
