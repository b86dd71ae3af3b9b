"""Tasks: what to follow, what it is worth, when it ends, what is drawn and what disturbs."""

from pma_gym.tasks.disturbances import DISTURBANCES, PULSE_S, Disturbances, Events
from pma_gym.tasks.follow import obstacle
from pma_gym.tasks.isotonic import ISOTONIC, isotonic, pressure_triangle
from pma_gym.tasks.limits import LIMITS, broken, broken_limit, limit_in_words
from pma_gym.tasks.randomisation import (
    CORNERS,
    FORCE_TOLERANCE,
    RANDOMISATIONS,
    VARIATION,
    Randomisation,
    nominal_station,
    station_within_intervals,
    varied_station,
)
from pma_gym.tasks.rewards import (
    GAUSSIAN_END,
    REWARDS,
    Reward,
    absolute_reward,
    gaussian_reward,
    missed_reward,
    quadratic_reward,
    smooth_reward,
)
from pma_gym.tasks.task import TASKS, TRIAL_TAIL_S, Actuator, Task, phase_errors, phase_rmse
from pma_gym.tasks.unseen import UNSEEN, following, multisine, sine, speeds, steps, unseen

EVERY_TASK: dict[str, Task] = {**TASKS, **UNSEEN, **ISOTONIC}
"""All tasks by name: the dissertation's two, those with unseen references, and those in which the
regulator contracts the muscle against a load."""


def named_task(name: str) -> Task | None:
    """The task of a name, also `displacement_multisine_17` and so on; None if there is none."""
    return EVERY_TASK.get(name) or unseen(name)


__all__ = [
    "CORNERS",
    "DISTURBANCES",
    "EVERY_TASK",
    "FORCE_TOLERANCE",
    "GAUSSIAN_END",
    "ISOTONIC",
    "LIMITS",
    "PULSE_S",
    "RANDOMISATIONS",
    "REWARDS",
    "TASKS",
    "TRIAL_TAIL_S",
    "UNSEEN",
    "VARIATION",
    "Actuator",
    "Disturbances",
    "Events",
    "Randomisation",
    "Reward",
    "Task",
    "absolute_reward",
    "broken",
    "broken_limit",
    "following",
    "gaussian_reward",
    "isotonic",
    "limit_in_words",
    "missed_reward",
    "multisine",
    "named_task",
    "nominal_station",
    "obstacle",
    "phase_errors",
    "phase_rmse",
    "pressure_triangle",
    "quadratic_reward",
    "sine",
    "smooth_reward",
    "speeds",
    "station_within_intervals",
    "steps",
    "varied_station",
]
