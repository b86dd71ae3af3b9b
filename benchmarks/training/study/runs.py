"""Trains what a study asks for, several at a time; what is there already is not trained again."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

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
    todo: Sequence[Run], jobs: int, told: Callable[[Run, PolicyFile, int, int], None]
) -> int:
    """Train what has no policy yet.

    Args:
        todo: trainings.
        jobs: processes.
        told: is told of each: the training, its policy, how many are done and how many there are.
    Returns:
        How many were trained.
    """
    missing = [run for run in todo if not run.path.exists()]
    # Spawned: kernels and PyTorch have threads. A process keeps the stations that it has drawn.
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        futures = {pool.submit(train_one, run): run for run in missing}
        try:
            for done, future in enumerate(as_completed(futures), 1):
                run = futures[future]
                future.result()
                told(run, load_policy_file(run.path), done, len(missing))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return len(missing)


def train_one(run: Run) -> float:
    """Train, and write the policy; how long it took (s)."""
    began = time.perf_counter()
    run.folder.mkdir(parents=True, exist_ok=True)
    order = Order(run.cell.resolved, run.seed)
    trained = train(order, run.folder / f".{run.path.stem}", lambda steps, point: None)
    save_policy_file(policy_of(order, trained), run.path)
    return time.perf_counter() - began
