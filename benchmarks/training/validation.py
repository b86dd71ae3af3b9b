"""Validation error of a policy on stations that it was not trained on."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from benchmarks.report.errors import Measure, measures, task_of
from benchmarks.report.statistics import interquartile_mean
from pma_gym.units import SI_FACTORS

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

SEED = 4_000_000
"""Seed of the first validation episode."""


class Point(NamedTuple):
    """A validation on the learning curve; errors over its episodes in the task's unit.

    Attributes:
        steps: control steps so far.
        wall_s: wall time so far, validations included (s).
        error: interquartile mean of the RMSE (mm or deg), of the phases that the suites' first
            measure of the task has: in rotation I and II.
        broken: how many episodes broke a physical limit; such a one has the error of the range.
        reward: mean reward of an episode.
        mean: mean of the RMSE of all episodes: one station that is lost shows here, not in `error`.
    """

    steps: int
    wall_s: float
    error: float
    broken: int
    reward: float
    mean: float


def measure_of(task: str) -> Measure:
    """The suites' first measure of a task; of an exercise all phases together."""
    named = task_of(task)
    if named.exercise is not None:
        return Measure(named.title, (task,), named.schedule.unit)
    return measures([task])[0]


def validate(
    model: Any,  # noqa: ANN401
    envs: "VecEnv",
    task: str,
    wall_s: float,
) -> Point:
    """Let a policy drive one episode in every environment, without exploring.

    Args:
        model: of Stable-Baselines3.
        envs: as `validation_environments` makes them.
        task: name of the task.
        wall_s: wall time so far (s).
    """
    envs.seed(SEED)
    observations: Any = envs.reset()
    measure = measure_of(task)
    errors = np.full(envs.num_envs, np.nan)
    rewards, broken = np.zeros(envs.num_envs), 0
    while np.isnan(errors).any():
        actions, _ = model.predict(observations, deterministic=True)
        observations, gained, over, infos = envs.step(actions)
        running = np.isnan(errors)
        rewards[running] += gained[running]
        for i in np.flatnonzero(over & running).tolist():
            failed = not infos[i]["TimeLimit.truncated"]
            broken += failed
            errors[i] = measure.of_row(_row(task, infos[i], failed))
    error, mean = float(interquartile_mean(errors)), float(errors.mean())
    return Point(model.num_timesteps, wall_s, error, broken, float(rewards.mean()), mean)


def _row(task: str, info: dict[str, Any], failed: bool) -> dict[str, Any]:
    """An episode's end as a row of a suite's journal."""
    schedule = task_of(task).schedule
    phases = () if failed else (phase.name for phase in schedule.phases)
    return {
        "task": task,
        "failure": "a limit" if failed else "",
        "phases": {name: {"rmse": info[f"rmse_{name}_{schedule.suffix}"]} for name in phases},
    }


def unit_of(task: str) -> str:
    """Unit of a task's errors: mm, deg or N m."""
    unit = task_of(task).schedule.unit
    assert unit in SI_FACTORS
    return unit
