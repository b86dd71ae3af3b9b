"""Episodes of controllers on any rig, and their scores."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from controllers.rigs import RigController, RigMeasurement
from pma_gym.envs import RigEnv, RigInfo
from pma_gym.pages.document import TextTable
from pma_gym.plant.model import Model


class Score(NamedTuple):
    """Score of an episode.

    Attributes:
        rig: which rig it ran on.
        controller: name of the controller.
        task: name of the task.
        seed: of the episode.
        percent: root mean square error of the true signal at 384 Hz, in percent of the range.
        rmse: the same in SI.
        ended_by: bound that ended it; "" if none.
        act_us: mean time of an answer (us).
    """

    rig: str
    controller: str
    task: str
    seed: int
    percent: float
    rmse: float
    ended_by: str
    act_us: float


def info_of(env: RigEnv, nominal: Model | None = None) -> RigInfo:
    """What a controller receives of a rig, with another model of it if one is given."""
    info = env.station
    return info if nominal is None else replace(info, model=nominal)


def run_episode(
    env: RigEnv, controller: RigController, seed: int, nominal: Model | None = None
) -> tuple[dict[str, Any], float, float]:
    """Run an episode: the last info, mean change of the action in a step, mean time to act (s)."""
    observation, info = env.reset(seed=seed)
    controller.reset(info_of(env, nominal))
    spent, moved, before, steps, ended = 0.0, 0.0, None, 0, False
    while not ended:
        start = time.perf_counter()
        commands = controller.act(RigMeasurement(env.measurement, observation, env.time))
        spent += time.perf_counter() - start
        action = env.action(*commands)
        moved += 0.0 if before is None else float(np.abs(action - before).max())
        observation, _, terminated, truncated, info = env.step(action)
        before, steps, ended = action, steps + 1, terminated or truncated
    if env.ended_by:
        # What is left of the trial is missed by the whole range.
        left = 1.0 - steps / env.task.steps(env.options.control_rate_hz)
        info["percent_of_range"] = np.hypot(info["percent_of_range"], 100.0 * left**0.5)
    return info, moved / steps, spent / steps


def scores(
    rig: str,
    options: Mapping[str, Any],
    controllers: Mapping[str, tuple[RigController, Mapping[str, Any]]],
    tasks: Sequence[str],
    seeds: Sequence[int],
    nominal: Model | None = None,
) -> list[Score]:
    """Score controllers on tasks, each under the same noise and the same drawn rigs.

    Args:
        rig: name of the rig in the table.
        options: of the environment.
        controllers: each with options of the environment that it needs beside these.
        tasks: names of tasks.
        seeds: of the episodes.
        nominal: model that controllers receive, where it is not the environment's.
    """
    rows = []
    for task in tasks:
        for name, (controller, own) in controllers.items():
            env = RigEnv(task, **{**options, **own})
            for seed in seeds:
                info, _, spent = run_episode(env, controller, seed, nominal)
                rmse = float(info[f"rmse_{env.task.schedule.suffix}"])
                percent = float(info["percent_of_range"])
                rows.append(Score(rig, name, task, seed, percent, rmse, env.ended_by, 1e6 * spent))
    return rows


def score_table(rows: Sequence[Score]) -> TextTable:
    """Mean error by rig, controller and task, with its standard error over the seeds."""
    tasks = list(dict.fromkeys(row.task for row in rows))
    body = []
    for rig, name in dict.fromkeys((row.rig, row.controller) for row in rows):
        own = [row for row in rows if (row.rig, row.controller) == (rig, name)]
        cells = []
        for task in tasks:
            values = np.array([row.percent for row in own if row.task == task])
            spread = values.std(ddof=1) / len(values) ** 0.5 if len(values) > 1 else 0.0
            ends = sum(bool(row.ended_by) for row in own if row.task == task)
            cells.append(
                f"{values.mean():.3g} ± {spread:.1g}" + (f" ({ends} ended)" if ends else "")
            )
        mean = np.mean([row.percent for row in own])
        body.append([rig, name, *cells, f"{mean:.3g}", f"{np.mean([r.act_us for r in own]):.0f}"])
    header = ["Rig", "Controller", *tasks, "mean", "us a step"]
    return TextTable("RMSE in % of the range, ± standard error", header, body, words=2)
