"""Tasks: what to follow, what it is worth, when it ends, what is drawn and what disturbs."""

from pma_gym.tasks.disturbances import DISTURBANCES, PULSE_S, Disturbances, Events
from pma_gym.tasks.exercise import LOWEST_RATE_HZ, PACE, PLAN_ANGLES, Exercise
from pma_gym.tasks.exercises import (
    EXERCISES,
    isokinetic_exercise,
    isotonic_exercise,
    moment_exercise,
    numbered_exercise,
)
from pma_gym.tasks.isotonic import ISOTONIC, infeasibility_reason, isotonic, pressure_triangle
from pma_gym.tasks.operator import (
    OPERATOR_BOUNDS,
    PACED,
    PACING,
    MomentProfile,
    Operator,
    OperatorState,
    Population,
    moment_profile,
)
from pma_gym.tasks.randomisation import (
    CORNERS,
    FORCE_TOLERANCE,
    RANDOMISATIONS,
    VARIATION,
    OneOf,
    Randomisation,
    Ranges,
    Uncertainty,
    nominal_station,
    station_within_intervals,
    varied_station,
)
from pma_gym.tasks.task import (
    GAUSSIAN_END,
    LIMITS,
    REWARDS,
    TASKS,
    TRIAL_TAIL_S,
    Actuator,
    Reward,
    Task,
    absolute_reward,
    broken,
    broken_limit,
    gaussian_reward,
    limit_in_words,
    missed_reward,
    phase_errors,
    phase_rmse,
    quadratic_reward,
    smooth_reward,
    unsafe,
)
from pma_gym.tasks.tracking import KINDS, TrackingTask, as_tracking, named_tracking, tracking
from pma_gym.tasks.unseen import UNSEEN, following, multisine, sine, speeds, steps, unseen

EVERY_TASK: dict[str, Task] = {**TASKS, **UNSEEN, **ISOTONIC, **EXERCISES}
"""All tasks by name: the dissertation's two, those with unseen references, those in which the
regulator contracts the muscle against a load, and those in which it resists an operator."""


def named_task(name: str) -> Task | None:
    """The task of a name, also `displacement_multisine_17` and `isotonic_exercise_6.5`, or None."""
    return EVERY_TASK.get(name) or unseen(name) or numbered_exercise(name)


__all__ = [
    "CORNERS",
    "DISTURBANCES",
    "EVERY_TASK",
    "EXERCISES",
    "FORCE_TOLERANCE",
    "GAUSSIAN_END",
    "OPERATOR_BOUNDS",
    "ISOTONIC",
    "KINDS",
    "LIMITS",
    "LOWEST_RATE_HZ",
    "PACE",
    "PACED",
    "PACING",
    "PLAN_ANGLES",
    "PULSE_S",
    "RANDOMISATIONS",
    "REWARDS",
    "TASKS",
    "TRIAL_TAIL_S",
    "UNSEEN",
    "OneOf",
    "Uncertainty",
    "VARIATION",
    "Actuator",
    "Disturbances",
    "Events",
    "Exercise",
    "Operator",
    "OperatorState",
    "MomentProfile",
    "Population",
    "Randomisation",
    "Ranges",
    "Reward",
    "Task",
    "TrackingTask",
    "absolute_reward",
    "as_tracking",
    "broken",
    "broken_limit",
    "following",
    "gaussian_reward",
    "isokinetic_exercise",
    "isotonic",
    "isotonic_exercise",
    "limit_in_words",
    "missed_reward",
    "moment_exercise",
    "multisine",
    "named_task",
    "named_tracking",
    "nominal_station",
    "numbered_exercise",
    "infeasibility_reason",
    "phase_errors",
    "phase_rmse",
    "moment_profile",
    "pressure_triangle",
    "quadratic_reward",
    "sine",
    "smooth_reward",
    "speeds",
    "station_within_intervals",
    "steps",
    "tracking",
    "unsafe",
    "varied_station",
]
