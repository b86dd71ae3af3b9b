"""Score of an episode: RMSE by phase, from sums that the engine accumulates.

This file also builds the last info of an episode, for one environment or many.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.cpu.python_step import TRUTHS
from pma_gym.engine.engine import Engine
from pma_gym.engine.state_layout import PEAKS, WORK
from pma_gym.envs.batch import spread
from pma_gym.metrics import percent_of_range
from pma_gym.tasks import PACE, Task, limit_in_words
from pma_gym.units import SI_FACTORS


def last_info(engine: Engine, index: int) -> dict[str, Any]:
    """Return the info of the step that ends an environment's episode, with the summary."""
    row = engine.row(index)
    return _step_info(engine, row) | _episode_summary(engine, index, row)


def last_infos(
    engine: Engine, over: NDArray[np.bool_], indices: NDArray[np.int64]
) -> dict[str, Any]:
    """Return the last infos of a batch's ended episodes, in Gymnasium's form: arrays with masks.

    Args:
        engine: engine of the batch.
        over: environments whose episode ended, shape (num_envs,).
        indices: their indices.
    """
    task = engine.task
    columns = engine.rows(indices).T
    numbers = {name: columns[place] for name, place in engine.state_layout.offsets.items()}
    sums = {phase.name: numbers[f"sum_{phase.name}"] for phase in task.schedule.phases}
    columns_by_name: dict[str, Any] = {name: numbers[name] for name in engine.state_layout.info}
    columns_by_name |= {name: columns_by_name[name] != 0.0 for name in TRUTHS}
    columns_by_name |= summaries(task, sums, numbers["sample"])
    if task.exercise:
        counts = engine.counts()[indices]
        columns_by_name |= exercise_summaries(numbers, counts, engine.options.period)
    pairs = zip(indices.tolist(), numbers["ended"].tolist(), strict=True)
    limits = [limit_in_words(engine.models[i], code, task.exercise) for i, code in pairs]
    columns_by_name["ended_by"] = np.array(limits, object)
    return spread(columns_by_name, over, indices)


def step_info(engine: Engine, index: int) -> dict[str, Any]:
    """Return the values of an environment's last step or reset, keyed as `PMAEnv`'s info."""
    return _step_info(engine, engine.row(index))


def episode_summary(engine: Engine, index: int) -> dict[str, Any]:
    """Return the summary of an environment's episode so far, see `PMAEnv.episode_summary`."""
    return _episode_summary(engine, index, engine.row(index))


def _step_info(engine: Engine, row: list[float]) -> dict[str, Any]:
    keys, first = engine.state_layout.info, engine.state_layout.offsets["ended"] + 1
    info = dict(zip(keys, row[first : first + len(keys)], strict=True))
    return info | {name: info[name] != 0.0 for name in TRUTHS}


def _episode_summary(engine: Engine, index: int, row: list[float]) -> dict[str, Any]:
    task, offsets = engine.task, engine.state_layout.offsets
    sums = {phase.name: row[offsets[f"sum_{phase.name}"]] for phase in task.schedule.phases}
    score = summary(task, sums, row[offsets["sample"]])
    code = row[offsets["ended"]]
    score["ended_by"] = limit_in_words(engine.models[index], code, task.exercise)
    if task.exercise is None:
        return score
    numbers = {name: np.array([row[offsets[name]]]) for name in exercise_offsets()}
    other = exercise_summaries(numbers, np.array([engine.steps(index)]), engine.options.period)
    return score | {name: float(values[0]) for name, values in other.items()}


def summary(task: Task, sums: Mapping[str, float], samples: float) -> dict[str, Any]:
    """Return the RMSE of the true position at 384 Hz so far, in file units.

    Args:
        task: the task.
        sums: sums of squared errors (m^2 or rad^2) by phase, each against its ideal line.
        samples: number of samples so far, the first at the trial's start.
    Returns:
        rmse_mm or rmse_deg over all phases, rmse_by_phase_mm or _deg of each phase so far,
        percent_of_range.
    """
    schedule = task.schedule
    unit, factor = schedule.suffix, SI_FACTORS[schedule.unit]
    counts = {
        phase.name: min(max(samples - phase.first, 0.0), phase.samples) for phase in schedule.phases
    }
    begun = {name: count for name, count in counts.items() if count > 0.0}
    total = math.sqrt(sum(sums[name] for name in begun) / sum(begun.values()))
    return {
        f"rmse_{unit}": total / factor,
        f"rmse_by_phase_{unit}": {
            name: math.sqrt(sums[name] / count) / factor for name, count in begun.items()
        },
        "percent_of_range": percent_of_range(total, schedule.span),
    }


def summaries(
    task: Task, sums: Mapping[str, NDArray[np.float64]], samples: NDArray[np.float64]
) -> dict[str, Any]:
    """Compute `summary` for many episodes at once, with equal bits; NaN for a phase not begun.

    Args:
        task: the task.
        sums: sums of squared errors (m^2 or rad^2) by phase, shape (m,) each.
        samples: number of samples so far, shape (m,).
    """
    schedule = task.schedule
    unit, factor = schedule.suffix, SI_FACTORS[schedule.unit]
    total, number, by_phase = np.zeros(len(samples)), np.zeros(len(samples)), {}
    for phase in schedule.phases:
        count = np.clip(samples - phase.first, 0.0, phase.samples)
        begun = count > 0.0
        # A phase that has not begun adds nothing: its sum is 0.
        total, number = total + sums[phase.name], number + count
        mean = np.divide(sums[phase.name], count, out=np.full(len(count), np.nan), where=begun)
        by_phase[phase.name] = np.sqrt(mean) / factor
    whole = np.sqrt(total / number)
    return {
        f"rmse_{unit}": whole / factor,
        f"rmse_by_phase_{unit}": by_phase,
        "percent_of_range": 100.0 * whole / schedule.span,
    }


def exercise_offsets() -> list[str]:
    """Offsets in the engine's record of the numbers for `exercise_summaries`."""
    return [*PEAKS, *WORK, *(f"pace_{phase.name}" for phase in PACE.phases)]


def exercise_summaries(
    numbers: Mapping[str, NDArray[np.float64]], counts: NDArray[np.int64], period: float
) -> dict[str, NDArray[np.float64]]:
    """Return the scores of exercises in addition to the RMSE, in file units.

    Args:
        numbers: numbers of `exercise_offsets` by name, shape (m,) each.
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
