"""Exercises as tasks: of one speed, of one moment, of a moment over the angle.

An exercise: an operator turns the joint, the regulator sets what he works against.

The motor plays the operator (`pma_gym.tasks.operator`): out to 90 deg in 5 s, 5 s there, back in
5 s, as in the dissertation's rotation. What the device is to do is prescribed:

    isokinetic    hold the joint's speed at 18 deg/s whatever the operator's effort
    isotonic      hold the moment at the joint
    profile       hold the moment that is prescribed at the joint's angle

Neither moment nor speed may exceed what is safe: an episode ends there, and a safety layer between
agent and regulator keeps away from it (`pma_gym.tasks.safety_filter`).

Source:
    Serres 2008, sections 3.3, 4.3 and 6.3. Moments of the prescriptions, safe moment and safe speed
    are our choice.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from pma_gym.data.trial_schedule import ROTATION, Phase, TrialSchedule
from pma_gym.tasks.operator import PACED, PACING, MomentProfile, Population, moment_profile
from pma_gym.tasks.safety_filter import FILTER_PACED, FILTER_PACING, SafetyFilter
from pma_gym.tasks.task import TASKS, Task
from pma_gym.units import SI_FACTORS

_DEG = SI_FACTORS["deg"]

PACE = ROTATION
"""Angle that the operator means to have: the dissertation's rotation."""

SAFE_MOMENT = 24.0
"""Moment at the joint that ends an episode (N m): 95 % of the 25.3 N m that the station's motor
holds with 10 V, so that whoever it plays can bear it."""

SAFE_SPEED = 60.0 * _DEG
"""Speed of the joint that ends an episode (rad/s): the slow speed of isokinetic tests, more than
three times the exercise's; an assumption, no standard was found that names one."""

PLAN_ANGLES = tuple(15.0 * _DEG * i for i in range(7))
"""Angles (rad) between which the operator's plan of an isokinetic exercise is linear."""

LOWEST_RATE_HZ = 50.0
"""Control steps a second that the motor needs to play the people that are drawn (Hz), whose joints
have up to 60 N m/rad; a stiffer one needs more."""


@dataclass(frozen=True)
class Exercise:
    """An exercise: its prescription, its operators and its safety limits.

    Attributes:
        prescription: moment over the angle; None where the speed is prescribed.
        population: distribution of the operators.
        safety_filter: numbers of the safety layer.
        safe_moment: largest moment at the joint (N m).
        safe_speed: largest speed of the joint (rad/s).
    """

    prescription: MomentProfile | None
    population: Population
    safety_filter: SafetyFilter
    safe_moment: float = SAFE_MOMENT
    safe_speed: float = SAFE_SPEED

    @property
    def start_moment(self) -> float:
        """Moment that an episode begins with (N m)."""
        return self.prescription.first if self.prescription else 0.0

    @property
    def knots(self) -> int:
        """Knots of the operator's plan."""
        return len(self.prescription.angles if self.prescription else PLAN_ANGLES)

    @property
    def structure(self) -> tuple[object, ...]:
        """The part that compiled environments depend on: no moment, no operator's parameters."""
        prescribed = "speed" if self.prescription is None else "moment"
        return (
            "exercise",
            prescribed,
            self.knots,
            self.safety_filter,
            self.safe_moment,
            self.safe_speed,
        )


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
