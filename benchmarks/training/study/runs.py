"""Trains what a study asks for, several at a time; what is there already is not trained again."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from benchmarks.executors.executor import Executor, run_or_raise
from benchmarks.training.policy_export.product import policy_name, policy_of
from benchmarks.training.run import Order, train
from benchmarks.training.study.cells import Cell
from controllers.policies.policy_file import PolicyFile, load_policy_file, save_policy_file


class Run(NamedTuple):
    """One training of a study.

    Attributes:
        cell: which.
        seed: its seed.
        folder: of the seed's policies.
    """

    cell: Cell
    seed: int
    folder: Path

    @property
    def path(self) -> Path:
        """The policy's .json file."""
        return self.folder / f"{policy_name(self.cell.resolved)}.json"


def runs(cells: Sequence[Cell], out: Path) -> list[Run]:
    """All trainings of some cells, seed by seed, so that an interrupted study compares them."""
    return [
        Run(cell, seed, out / cell.group / f"seed-{seed}")
        for seed in range(max(cell.seeds for cell in cells))
        for cell in cells
        if seed < cell.seeds
    ]


def train_all(
    todo: Sequence[Run], executor: Executor, on_done: Callable[[Run, PolicyFile, int, int], None]
) -> int:
    """Train what has no policy yet.

    Args:
        todo: trainings.
        executor: where.
        on_done: called with each training, its policy, how many are done and how many there are.
    Returns:
        How many were trained.
    """
    missing = [run for run in todo if not run.path.exists()]
    done = 0

    def keep(index: int, _: float) -> None:
        nonlocal done
        done += 1
        run = missing[index]
        on_done(run, load_policy_file(run.path), done, len(missing))

    run_or_raise([partial(train_one, run) for run in missing], executor, keep)
    return len(missing)


def train_one(run: Run) -> float:
    """Train, and write the policy; how long it took (s)."""
    began = time.perf_counter()
    run.folder.mkdir(parents=True, exist_ok=True)
    order = Order(run.cell.resolved, run.seed)
    trained = train(order, run.folder / f".{run.path.stem}", lambda steps, point: None)
    save_policy_file(policy_of(order, trained), run.path)
    return time.perf_counter() - began
