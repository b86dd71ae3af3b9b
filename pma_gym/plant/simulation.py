"""Whole trials, many at once: what simulations and fits run."""

import os
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pma_gym.plant.program import FIRST_S, Program
from pma_gym.plant.trial_kernel import JOB

FEW = 4
"""Fewer trials than this run in scalar code, whose single step is faster."""


@dataclass
class Run:
    """One trial to be simulated, and its result.

    Attributes:
        time: increasing times (s), shape (rows,).
        motor: motor voltage at them (V), shape (rows,).
        regulator: regulator voltage at them (V), shape (rows,).
        joined: commands are joined linearly; else each is held until the next.
        table: what is fixed for the model (`Plant.table`).
        state: state vector at the first time.
        zero_contraction: contraction x0 that the trial began at with no load (m).
        size: size of the first internal step (s); afterwards that of the next.
        states: the result: the state vector at each time, shape (rows, states); written to an
            array that is there already if it has this shape.
    """

    time: np.ndarray
    motor: np.ndarray
    regulator: np.ndarray
    joined: bool
    table: np.ndarray
    state: np.ndarray
    zero_contraction: float
    size: float = FIRST_S
    states: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))


def simulate_all(program: Program, runs: Sequence[Run], threads: int = 1) -> int:
    """Simulate trials of models of one structure; each run gets its states.

    What becomes of a trial depends neither on the others nor on the number of threads.

    Args:
        program: the compiled functions of their structure.
        runs: the trials.
        threads: how many threads share them.
    Returns:
        How many attempts at internal steps were made, counting all lanes of a register as one.
    Raises:
        ValueError: a table of another structure, or columns of different lengths.
    """
    wide = len(runs) >= FEW
    kernel = program.simulate_many if wide else program.simulate_one
    count = len(program.states)
    jobs = np.zeros((len(runs), len(JOB)), np.int64)
    kept: list[np.ndarray] = []
    starts = []
    for run, job in zip(runs, jobs, strict=True):
        _check(program, run)
        columns = [np.ascontiguousarray(c, float) for c in (run.time, run.motor, run.regulator)]
        start = np.concatenate([run.state, [run.size, run.zero_contraction]])
        if run.states.shape != (len(run.time), count):
            run.states = np.empty((len(run.time), count))
        arrays = [*columns, run.table, start, run.states]
        kept += arrays
        starts.append(start)
        job[:] = [len(run.time), run.joined, *(array.ctypes.data for array in arrays)]
        if len(run.time) == 1:
            run.states[0] = run.state
    # The longest first, so that the last lanes do not wait for one of them.
    order = np.argsort([-len(run.time) for run in runs], kind="stable")
    long = np.ascontiguousarray(jobs[[i for i in order if len(runs[i].time) > 1]])
    parts = [np.ascontiguousarray(long[k::threads]) for k in range(threads)]
    made = np.zeros((threads, 8), np.int64)

    def work(k: int, _: object = None) -> None:
        kernel(len(parts[k]), parts[k].ctypes.data, made[k].ctypes.data)

    # The threads hold what they write to, should a second Ctrl-C end this call before them.
    others = [threading.Thread(target=work, args=(k, kept)) for k in range(1, threads)]
    for other in others:
        other.start()
    try:
        work(0)
    finally:
        for other in others:
            other.join()
    for run, start in zip(runs, starts, strict=True):
        run.size = float(start[count])
    return int(made[:, 0].sum())


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _check(program: Program, run: Run) -> None:
    rows = {len(column) for column in (run.time, run.motor, run.regulator)}
    if len(rows) != 1:
        raise ValueError(
            f"time, motor and regulator of a run must have one length; got {sorted(rows)}"
        )
    if run.table.shape != (program.table_size,) or run.state.shape != (len(program.states),):
        raise ValueError(
            f"all runs of one call must be of models of one structure (the same effects): a table "
            f"of {program.table_size} numbers and {len(program.states)} states; got "
            f"{run.table.size} and {run.state.size}; simulate the other models in a call of "
            "their own"
        )
