"""Controllers of an exercise, scored with operators that no policy was trained with.

    python -m benchmarks.training.study.operators constant_pressure speed_pid ppo

Seeds of the operators begin at 7 000 000: those of trainings are made from a training's seed, and
validation begins at 4 000 000. Drawn stations are further draws than those of training and
validation.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.training.stations import Stations
from controllers import CONTROLLERS
from controllers.controller import Controller
from controllers.policy import Policy
from pma_gym.envs import PMAEnv
from pma_gym.tasks import named_task

SEED = 7_000_000
"""Seed of the first operator."""

FIRST, STATIONS = 20_000, 200
"""Number of the first drawn station, and how many there are."""


class Judged(NamedTuple):
    """Results of operators.

    Attributes:
        errors: RMSE of those whose episode went to its end, shape (n, phases), in the task's unit.
        ended: how many ended at a limit.
    """

    errors: NDArray[np.float64]
    ended: int


def judged(
    controller: Controller, count: int, task: str = "isokinetic_exercise", drawn: bool = False
) -> Judged:
    """Let operators work against a controller, one trial each.

    Args:
        controller: who commands the regulator.
        count: how many operators.
        task: name of an exercise.
        drawn: whether each has a drawn station; else all have the nominal one.
    """
    options: dict[str, Any] = {}
    if drawn:
        stations = Stations("robust", FIRST, STATIONS)
        options = {"randomisation": stations, "model": stations.structure}
    env, errors = PMAEnv(task, **options), []
    key = f"rmse_by_phase_{env.task.schedule.suffix}"
    for seed in range(SEED, SEED + count):
        info = _driven(env, controller, seed)
        if info is not None:
            errors.append(list(env.episode_summary()[key].values()))
    phases = len(env.task.schedule.phases)
    return Judged(np.array(errors).reshape(-1, phases), count - len(errors))


def _driven(env: PMAEnv, controller: Controller, seed: int) -> dict[str, Any] | None:
    """Info of a trial's end; None if it ended at a limit."""
    env.reset(seed=seed)
    controller.reset(env.reference, env.station)
    while True:
        command: Any = env.action(controller.act(env.measurement, env.time))
        _, _, terminated, truncated, info = env.step(command)
        if terminated or truncated:
            return None if terminated else info


def named_controller(name: str) -> Controller:
    """A controller of the benchmark, or a policy's file."""
    return CONTROLLERS[name]() if name in CONTROLLERS else Policy(Path(name))


def figures_of(names: Sequence[str], count: int, task: str) -> dict[str, Any]:
    """Mean RMSE by phase on the nominal station and on drawn ones, as JSON.

    Args:
        names: of controllers.
        count: how many operators.
        task: name of an exercise.
    """
    known = named_task(task)
    assert known is not None
    rows = []
    for stations in ("nominal", "drawn"):
        for name in names:
            controller = named_controller(name)
            one = judged(controller, count, task, stations == "drawn")
            means = one.errors.mean(axis=0).round(4).tolist()
            row = {"controller": controller.name, "stations": stations, "rmse": means}
            rows.append(row | {"ended": one.ended})
    phases = [phase.name for phase in known.schedule.phases]
    return {"count": count, "unit": known.schedule.unit, "phases": phases, "rows": rows}


def table_of(figures: Mapping[str, Any]) -> list[str]:
    """Lines of a table in Markdown, of `figures_of`."""
    phases = " | ".join(f"{phase} ({figures['unit']})" for phase in figures["phases"])
    columns = len(figures["phases"]) + 1
    lines = [f"| Controller | Stations | {phases} | Ended |", "| :-- | :-- |" + " --: |" * columns]
    for row in figures["rows"]:
        means = " | ".join(f"{value:.2f}" for value in row["rmse"])
        lines.append(f"| {row['controller']} | {row['stations']} | {means} | {row['ended']} |")
    return lines


def main(
    names: Annotated[list[str], typer.Argument(help="Controllers, policy files.")],
    count: Annotated[int, typer.Option(min=1, help="Operators.")] = 256,
    task: Annotated[str, typer.Option(help="Name of an exercise.")] = "isokinetic_exercise",
) -> None:
    """Print how controllers of an exercise do."""
    print("\n".join(table_of(figures_of(names, count, task))))


if __name__ == "__main__":
    typer.run(main)
