"""Tasks: a schedule, the actuator that moves, the pressures, and the scores.

Physical limits of the rig, and safety limits of an exercise.

Rewards of a step, by name.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial_schedule import DISPLACEMENT, ROTATION, TrialSchedule
from pma_gym.metrics import PHASE_DURATION, PHASE_SAMPLES, SAMPLE_RATE_HZ, rmse

if TYPE_CHECKING:
    from pma_gym.tasks.exercise import Exercise
from collections.abc import Callable, Mapping

from pma_gym.codegen.generic import where
from pma_gym.effects.arithmetic import exponential
from pma_gym.plant.model import Model
from pma_gym.tasks.exercise import Exercise
from pma_gym.units import SI_FACTORS

TRIAL_TAIL_S = (PHASE_SAMPLES - 1) / SAMPLE_RATE_HZ - PHASE_DURATION
"""How far past its 5 s the last phase is recorded (s): its last sample is at 1922 / 384 s."""

Actuator = Literal["motor", "regulator"]
"""Which of the two voltages a task's controller gives; the other one is held."""


@dataclass(frozen=True)
class Task:
    """A schedule to follow, who moves, and the pressures to do it at.

    Attributes:
        name: such as `displacement`.
        schedule: phases and ideal reference.
        lowest_pressure: lower end of the pressures of the dissertation's trials (Pa).
        highest_pressure: upper end (Pa).
        actuator: whose voltage the action is. The regulator's contracts the muscle against `load`,
            and the quantity is `contraction`; the motor's pulls it at one pressure.
        load: load that the motor holds where the regulator moves (N); 0 where the motor moves.
        start_pressures: range of the pressures that episodes begin at (Pa), as far as the model's
            validity has it; the trials' if None.
        exercise: of an operator, played by the motor while the regulator resists; else None.
    """

    name: str
    schedule: TrialSchedule
    lowest_pressure: float
    highest_pressure: float
    actuator: Actuator = "motor"
    load: float = 0.0
    start_pressures: tuple[float, float] | None = None
    exercise: "Exercise | None" = None

    def __post_init__(self) -> None:
        """Refuse what no environment can do."""
        if len(self.starts) != 2 or not 0.0 <= self.starts[0] <= self.starts[1] < float("inf"):
            raise ValueError(
                f"task {self.name}: start pressures must be two gauge pressures in Pa (kPa times "
                f"1000) from 0 on, the lower first, got {self.starts}"
            )
        if self.exercise is None:
            self._check_mover()
        elif self.actuator != "regulator" or self.load:
            raise ValueError(
                f"task {self.name}: in an exercise the motor plays the operator and the regulator "
                f"moves; got {self.actuator} and a load of {self.load!r} N; leave both as they are"
            )
        self._check_reference()

    def _check_mover(self) -> None:
        if (self.actuator == "regulator") != (self.schedule.followed.shortens):
            raise ValueError(
                f"task {self.name}: the regulator contracts (quantity contraction) and the motor "
                f"pulls (extension or rotation), got {self.schedule.quantity} by the "
                f"{self.actuator}"
            )
        if (self.actuator == "regulator") != (self.load > 0.0):
            raise ValueError(
                f"task {self.name}: load must be the positive load (N) that the motor holds while "
                f"the regulator moves, and 0 where the motor moves, got {self.load!r} N"
            )

    def _check_reference(self) -> None:
        every = np.concatenate([phase.reference(phase.times) for phase in self.schedule.phases])
        if not np.all(np.isfinite(every)):
            raise ValueError(f"task {self.name}: the reference must be finite throughout")
        if abs(every[0]) > 1e-9 * self.schedule.span:
            raise ValueError(
                f"task {self.name}: the reference must begin at 0, where a trial begins, got "
                f"{every[0]:g} (m or rad); ramp it in"
            )

    @property
    def duration(self) -> float:
        """Duration of an episode (s), to the last scored sample."""
        return self.schedule.duration + TRIAL_TAIL_S

    @property
    def starts(self) -> tuple[float, float]:
        """Range of the pressures that episodes begin at (Pa)."""
        return self.start_pressures or (self.lowest_pressure, self.highest_pressure)

    @property
    def title(self) -> str:
        """Its name for people.

        >>> TASKS["rotation"].title
        'Isokinetic rotation'
        """
        name = self.name.replace("_", " ")
        if self.name in TASKS:
            return f"Isokinetic {name}"
        followed = self.schedule.followed
        contracts = followed.shortens and followed.name not in name
        return name.capitalize() + (" contraction" if contracts else "")

    @property
    def structure(self) -> tuple[str, ...]:
        """The part of the task that compiled environments depend on: no motion, no name.

        Two tasks of one structure share their compiled code, however their references differ.
        """
        schedule = self.schedule
        phases = [
            (p.start, p.duration, *((p.initial, p.slope) if p.motion is None else ("motion",)))
            for p in schedule.phases
        ]
        numbers = schedule.span, self.lowest_pressure, self.highest_pressure
        said = (self.actuator, schedule.quantity, schedule.unit, *numbers, *phases)
        if self.exercise:
            said += self.exercise.structure
        return tuple(map(repr, said))

    def steps(self, control_rate: float) -> int:
        """Control steps of an episode at a rate (Hz): the last one reaches the last sample.

        >>> [task.steps(100.0) for task in TASKS.values()]
        [501, 1501]
        """
        # Less than a sample's rounding: 384 Hz needs 1922 steps, not 1923.
        return math.ceil(self.duration * control_rate - 1e-9)

    def error_percent(self, error: Any) -> Any:  # noqa: ANN401
        """An error (m or rad) in percent of the task's range."""
        return 100.0 * error / self.schedule.span

    def ideals(self, samples: int) -> NDArray[np.float64]:
        """Ideal position (m or rad) at k / 384 s, shape (samples,), as a motion is scored.

        Args:
            samples: how many; beyond the last one that is scored the position stays.
        """
        time = np.arange(samples) / SAMPLE_RATE_HZ
        last = self.schedule.phases[-1]
        scored = (last.first + last.samples - 1) / SAMPLE_RATE_HZ
        return self.schedule.phases[0].reference(np.minimum(time, scored))


TASKS: dict[str, Task] = {
    "displacement": Task("displacement", DISPLACEMENT, 150e3, 575e3),
    "rotation": Task("rotation", ROTATION, 275e3, 575e3),
}
"""The dissertation's two tasks; figures 31-36 show them. `EVERY_TASK` has the others too."""


def phase_errors(
    schedule: TrialSchedule, position: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Error of a position on the 384 Hz grid, phase by phase, each on its own ideal line.

    Args:
        schedule: phases and ideal reference.
        position: extension (m), rotation (rad) or contraction (m) at k / 384 s, shape (n,).
    Returns:
        Error (m or rad) by phase name: 1923 samples of 5 s, or as many as there are.
    """
    errors = {}
    for phase in schedule.phases:
        actual = position[phase.first : phase.first + phase.samples]
        errors[phase.name] = actual - phase.reference(phase.times[: len(actual)])
    return errors


def phase_rmse(schedule: TrialSchedule, position: NDArray[np.float64]) -> dict[str, float]:
    """RMSE of a position on the 384 Hz grid, of each phase begun and of them all together.

    Args:
        schedule: phases and ideal reference.
        position: extension (m), rotation (rad) or contraction (m) at k / 384 s, shape (n,), n at
            least 1.
    Returns:
        RMSE (m or rad) by phase name, and `all`: over the samples of all phases.
    """
    started = {name: e for name, e in phase_errors(schedule, position).items() if len(e)}
    known = {name: rmse(error) for name, error in started.items()}
    return known | {"all": rmse(np.concatenate(list(started.values())))}


LIMITS: tuple[tuple[str, str, float], ...] = (
    ("contraction", "contraction", 1.0),
    ("contraction", "stretch", -1.0),
    ("load", "tension", 1.0),
    ("pressure", "pressure", 1.0),
)
"""Physical limits of the rig: output, the field of `[limits]` that bounds it, and its sign."""


def broken(limits: Any, truth: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Index (from 1) of the first of `LIMITS` that a state exceeds, else 0.0; numbers or traced.

    Args:
        limits: the rig's parameters of `[limits]` (SI).
        truth: contraction (m), load (N), pressure (Pa).
    """
    code = 0.0
    # A state that is no number keeps no limit. The first of several counts.
    for i, (output, limit, sign) in reversed(list(enumerate(LIMITS, 1))):
        code = where(sign * truth[output] <= getattr(limits, limit), code, float(i))
    return code


def unsafe(exercise: Exercise, moment: Any, speed: Any) -> Any:  # noqa: ANN401
    """Code of the safety limit that an exercise exceeds, counted on from `LIMITS`; 0.0 for none.

    Args:
        exercise: with its safe moment and speed.
        moment: at the joint (N m), a number or a traced value.
        speed: of the joint (rad/s).
    """
    code = float(len(LIMITS))
    # A joint that turns at no speed that is a number is not safe.
    speed_code = where(abs(speed) <= exercise.safe_speed, 0.0, code + 2.0)
    return where(moment <= exercise.safe_moment, speed_code, code + 1.0)


def broken_limit(model: Model, truth: Mapping[str, float]) -> str:
    """Name the physical limit of the rig that a state exceeds; "" if none.

    Args:
        model: the rig's model, with its limits.
        truth: contraction (m), load (N), pressure (Pa).
    """
    return limit_in_words(model, broken(model.parameters["limits"], truth))


def limit_in_words(model: Model, code: float, exercise: Exercise | None = None) -> str:
    """Name the limit that `broken` or `unsafe` returned; "" for 0."""
    if not code:
        return ""
    limits = model.parameters["limits"]
    texts = (
        f"contraction above {limits.contraction * 1e3:g} mm",
        f"muscle stretched over {limits.stretch * 1e3:g} mm beyond its resting length",
        f"cable tension above {limits.tension:g} N",
        f"pressure above {limits.pressure / 1e3:g} kPa",
    )
    if exercise:
        speed = exercise.safe_speed / SI_FACTORS["deg"]
        texts += (
            f"moment at the joint above the safe {exercise.safe_moment:g} N m",
            f"joint faster than the safe {speed:g} deg/s",
        )
    return texts[int(code) - 1]


def absolute_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """Minus the absolute error in percent of the range: -|e|."""
    return -abs(error_percent)


def quadratic_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """Minus the squared error in percent of the range: -e^2."""
    return -error_percent * error_percent


def gaussian_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """exp(-e^2) of the error in percent of the range, between 0 and 1; 0 beyond e^2 = 12."""
    square = error_percent * error_percent
    near = square < GAUSSIAN_END
    return where(near, exponential(-where(near, square, 0.0)), 0.0)


def smooth_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """The absolute reward less a tenth of the action's change: -|e| - 0.1 |da|."""
    return -abs(error_percent) - 0.1 * abs(change)


GAUSSIAN_END = 12.0
"""Squared error beyond which the gaussian reward is 0, where it would be 6e-6."""


Reward = Callable[[Any, Any], Any]
"""Reward of a step: of the true error at its end (percent of range), and of the largest change
of an action (which runs from -1 to 1) since the step before. Written in the arithmetic of laws, so
that kernels compute it too."""

REWARDS: dict[str, Reward] = {
    "absolute": absolute_reward,
    "quadratic": quadratic_reward,
    "gaussian": gaussian_reward,
    "smooth": smooth_reward,
}
"""Rewards by name."""


def missed_reward(reward: Reward) -> float:
    """Reward of each step that a terminated episode did not reach: an error of the whole range.

    Following badly to the end is worth more, so that breaking the rig never pays.
    """
    return reward(100.0, 0.0)
