"""Infos of steps and scores of episodes, for one environment or many.

All infos have the same keys, types and shapes: numbers of NumPy, so that libraries can record them.
Scores come from sums that the engine accumulates, and are 0 before an episode's last info.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.engine import Engine
from pma_gym.envs.batch import spread
from pma_gym.tasks import PACE, Task
from pma_gym.units import SI_FACTORS

Indices = Sequence[int] | NDArray[np.int64]

EXERCISE_SCORES = (
    *("pace_rmse_deg", "peak_moment_nm", "peak_speed_deg_s", "peak_power_w"),
    *("work_j", "returned_j"),
)
"""Keys of an exercise's scores in addition to the RMSE."""


def last_info(engine: Engine, index: int) -> dict[str, Any]:
    """Return the info of the step that ends an environment's episode, with the scores."""
    columns = _numbers(engine, [index]) | _scores(engine, [index])
    return {name: values[0] for name, values in columns.items()}


def last_infos(
    engine: Engine, over: NDArray[np.bool_], indices: NDArray[np.int64]
) -> dict[str, Any]:
    """Return the last infos of a batch's ended episodes, in Gymnasium's form: arrays with masks.

    Args:
        engine: engine of the batch.
        over: environments whose episode ended, shape (num_envs,).
        indices: their indices.
    """
    return spread(_numbers(engine, indices) | _scores(engine, indices), over, indices)


def step_info(engine: Engine, index: int) -> dict[str, Any]:
    """Return the values of an environment's last step or reset, keyed as `PMAEnv`'s info."""
    numbers = {name: values[0] for name, values in _numbers(engine, [index]).items()}
    return numbers | no_scores(engine.task)


def no_scores(task: Task) -> dict[str, Any]:
    """Return the scores in the infos before an episode's last: 0, as NaN equals no other NaN."""
    unit = task.schedule.suffix
    phases = [_phase_key(phase.name, unit) for phase in task.schedule.phases]
    other = EXERCISE_SCORES if task.exercise else ()
    keys = f"rmse_{unit}", *phases, "percent_of_range", *other
    return dict.fromkeys(keys, np.float64(0.0)) | {"limit_code": np.int64(0)}


def episode_summary(engine: Engine, index: int) -> dict[str, Any]:
    """Return the summary of an environment's episode so far, see `PMAEnv.episode_summary`."""
    score = {name: float(values[0]) for name, values in _scores(engine, [index]).items()}
    task, unit = engine.task, engine.task.schedule.suffix
    phases = {phase.name: score.pop(_phase_key(phase.name, unit)) for phase in task.schedule.phases}
    code = score.pop("limit_code")
    started = {name: value for name, value in phases.items() if not math.isnan(value)}
    limit = engine.limit_in_words(index, code)
    followed = {"task": engine.tasks[index].name, "ended_by": limit}
    return score | {f"rmse_by_phase_{unit}": started} | followed


def _phase_key(phase: str, unit: str) -> str:
    return f"rmse_{phase}_{unit}"


def _numbers(engine: Engine, indices: Indices) -> dict[str, NDArray[Any]]:
    """Numbers of the last step or reset by key, shape (m,) each."""
    first = engine.state_layout.offsets["ended"] + 1
    columns = engine.rows(np.asarray(indices))[:, first:].T
    return dict(zip(engine.state_layout.info, columns, strict=False))


def _scores(engine: Engine, indices: Indices) -> dict[str, NDArray[Any]]:
    """Scores of episodes so far by key, shape (m,) each."""
    task, indices = engine.task, np.asarray(indices)
    columns = engine.rows(indices).T
    numbers = {name: columns[place] for name, place in engine.state_layout.offsets.items()}
    sums = {phase.name: numbers[f"sum_{phase.name}"] for phase in task.schedule.phases}
    scores = summaries(task, sums, numbers["sample"])
    if task.exercise:
        counts = engine.counts()[indices]
        scores |= exercise_summaries(numbers, counts, engine.options.period)
    return scores | {"limit_code": numbers["ended"].astype(np.int64)}


def summaries(
    task: Task, sums: Mapping[str, NDArray[np.float64]], samples: NDArray[np.float64]
) -> dict[str, Any]:
    """Compute the RMSE of the true position at 384 Hz so far; NaN for a phase not begun.

    Args:
        task: the task.
        sums: sums of squared errors (m^2 or rad^2) by phase, shape (m,) each.
        samples: number of samples so far, the first at the trial's start, shape (m,).
    Returns:
        By name, shape (m,), in file units: rmse_mm or rmse_deg over all phases, rmse_I_mm and so on
        of each phase, percent_of_range.
    """
    schedule = task.schedule
    unit, factor = schedule.suffix, SI_FACTORS[schedule.unit]
    total, number, by_phase = np.zeros(len(samples)), np.zeros(len(samples)), {}
    for phase in schedule.phases:
        count = np.clip(samples - phase.first, 0.0, phase.samples)
        started = count > 0.0
        # A phase that has not begun adds nothing: its sum is 0.
        total, number = total + sums[phase.name], number + count
        mean = np.divide(sums[phase.name], count, out=np.full(len(count), np.nan), where=started)
        by_phase[_phase_key(phase.name, unit)] = np.sqrt(mean) / factor
    whole = np.sqrt(total / number)
    return {
        f"rmse_{unit}": whole / factor,
        **by_phase,
        "percent_of_range": 100.0 * whole / schedule.span,
    }


def exercise_summaries(
    numbers: Mapping[str, NDArray[np.float64]], counts: NDArray[np.int64], period: float
) -> dict[str, NDArray[np.float64]]:
    """Return the scores of exercises in addition to the RMSE, in file units.

    Args:
        numbers: numbers of the engine's record by name, shape (m,) each.
        counts: control steps so far, shape (m,).
        period: duration of a control step (s).
    Returns:
        By name, shape (m,): `pace_rmse_deg` of the angle against its ideal line, over all phases;
        `peak_moment_nm`, `peak_speed_deg_s`, `peak_power_w` (in either direction) at the ends of
        control steps; `work_j` by the joint on the device and `returned_j` by the device.
    """
    degree = SI_FACTORS["deg"]
    last = round(PACE.duration / period)
    steps = np.minimum(counts, last)
    squares = sum(numbers[f"pace_{phase.name}"] for phase in PACE.phases)
    return {
        "pace_rmse_deg": np.sqrt(squares / np.maximum(steps, 1)) / degree,
        "peak_moment_nm": numbers["peak_moment"],
        "peak_speed_deg_s": numbers["peak_speed"] / degree,
        "peak_power_w": numbers["peak_power"],
        "work_j": numbers["work"],
        "returned_j": numbers["returned"],
    }
