"""Simulation of many trials at once."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from pma_gym.codegen.threads.thread_pool import share
from pma_gym.integrator.equations import Interpolation, check_interpolation
from pma_gym.integrator.trial_kernel import JOB
from pma_gym.plant.program import FIRST_S, Program

FEW = 4
"""Below this number, trials run in scalar code, whose single step is faster."""


@dataclass
class Run:
    """One trial to be simulated, and its result.

    Attributes:
        time: increasing times (s), shape (rows,).
        motor: motor voltage at them (V), shape (rows,).
        regulator: regulator voltage at them (V), shape (rows,).
        interpolation: of the commands between rows: "foh" (linear) or "zoh" (held).
        table: constants of the model (`Plant.table`).
        state: state vector at the first time.
        zero_contraction: contraction x0 without load at the trial's start (m).
        size: size of the first internal step (s); afterwards that of the next.
        states: the result: the state vector at each time, shape (rows, states); an existing array
            of this shape is reused.
    """

    time: np.ndarray
    motor: np.ndarray
    regulator: np.ndarray
    interpolation: Interpolation
    table: np.ndarray
    state: np.ndarray
    zero_contraction: float
    size: float = FIRST_S
    states: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))


class Batch(NamedTuple):
    """One trial at many parameters, each from a state of its own.

    Attributes:
        time, motor, regulator, interpolation: as of a `Run`; float and contiguous.
        tables: constants of the model, shape (count, numbers).
        starts: state vectors at the first time, shape (count, states).
        zeros: contraction x0 at the trial's start (m), shape (count,).
        states: where the result goes, shape (count, rows, states), contiguous.
    """

    time: np.ndarray
    motor: np.ndarray
    regulator: np.ndarray
    interpolation: Interpolation
    tables: np.ndarray
    starts: np.ndarray
    zeros: np.ndarray
    states: np.ndarray


def simulate_batches(program: Program, batches: Sequence[Batch], threads: int = 1) -> int:
    """Simulate trials at many parameters each; as `simulate_all`, with less to do for each.

    Args:
        program: the compiled functions of their structure.
        batches: the trials.
        threads: number of threads.
    Returns:
        Number of attempted internal steps, as of `simulate_all`.
    """
    count, ends = len(program.states), np.cumsum([len(batch.tables) for batch in batches])
    jobs = np.empty((int(ends[-1]), len(JOB)), np.int64)
    starts = np.empty((len(jobs), count + 2))
    starts[:, count] = FIRST_S
    jobs[:, JOB.index("start")] = _addresses(starts)
    for end, batch in zip(ends.tolist(), batches, strict=True):
        here = slice(end - len(batch.tables), end)
        rows, columns = len(batch.time), (batch.time, batch.motor, batch.regulator)
        jobs[here, :5] = (
            rows,
            batch.interpolation == "foh",
            *(column.ctypes.data for column in columns),
        )
        jobs[here, JOB.index("table")] = _addresses(batch.tables)
        jobs[here, JOB.index("out")] = _addresses(batch.states)
        starts[here, :count], starts[here, count + 1] = batch.starts, batch.zeros
        if rows == 1:
            batch.states[:, 0] = batch.starts
    return _carry_out(program, jobs, threads, (starts, batches))


def _addresses(rows: np.ndarray) -> np.ndarray:
    """Address of each row of a contiguous array."""
    return rows.ctypes.data + rows.strides[0] * np.arange(len(rows))


def simulate_all(program: Program, runs: Sequence[Run], threads: int = 1) -> int:
    """Simulate trials of models of one structure, and write the states to each run.

    The result of a trial depends neither on the others nor on the number of threads.

    Args:
        program: the compiled functions of their structure.
        runs: the trials.
        threads: number of threads.
    Returns:
        Number of attempted internal steps; all lanes of a SIMD register count as one.
    Raises:
        ValueError: an unknown interpolation, a table of another structure, or columns of
            different lengths.
    """
    count = len(program.states)
    jobs = np.zeros((len(runs), len(JOB)), np.int64)
    starts = np.empty((len(runs), count + 2))
    known: dict[int, tuple[np.ndarray, int]] = {}

    def address(array: np.ndarray) -> int:
        """Address of an array's numbers; runs share many, and asking costs more than a step."""
        if id(array) not in known:
            numbers = np.ascontiguousarray(array, float)
            known[id(array)] = numbers, numbers.ctypes.data
        return known[id(array)][1]

    where, apart = starts.ctypes.data, starts.strides[0]
    for i, run in enumerate(runs):
        rows = _rows(program, run)
        starts[i, :count], starts[i, count:] = run.state, (run.size, run.zero_contraction)
        if run.states.shape != (rows, count):
            run.states = np.empty((rows, count))
        addresses = map(address, (run.time, run.motor, run.regulator, run.table))
        jobs[i] = (
            rows,
            run.interpolation == "foh",
            *addresses,
            where + i * apart,
            run.states.ctypes.data,
        )
        if rows == 1:
            run.states[0] = run.state
    attempts = _carry_out(program, jobs, threads, (known, starts, runs))
    for run, size in zip(runs, starts[:, count].tolist(), strict=True):
        run.size = size
    return attempts


def _carry_out(program: Program, jobs: np.ndarray, threads: int, kept: object) -> int:
    """Do the jobs of more than one row; how many steps were attempted."""
    kernel = program.simulate_many if len(jobs) >= FEW else program.simulate_one
    # The longest first, so that the last lanes do not wait for one of them.
    order = np.argsort(-jobs[:, 0], kind="stable")
    long = np.ascontiguousarray(jobs[order[jobs[order, 0] > 1]])
    taken, made = np.zeros(8, np.int64), np.zeros((threads, 8), np.int64)

    def work(k: int) -> None:
        kernel(len(long), long.ctypes.data, taken.ctypes.data, made[k].ctypes.data)

    share(work, threads, (kept, long))
    return int(made[:, 0].sum())


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _rows(program: Program, run: Run) -> int:
    """How many rows a run has, if it is one of the program's."""
    check_interpolation(run.interpolation)
    rows, *others = len(run.time), len(run.motor), len(run.regulator)
    if others != [rows, rows]:
        lengths = sorted({rows, *others})
        raise ValueError(f"time, motor and regulator of a run must have one length; got {lengths}")
    if run.table.shape != (program.table_size,) or run.state.shape != (len(program.states),):
        raise ValueError(
            f"all runs of one call must be of models of one structure (the same effects): a table "
            f"of {program.table_size} numbers and {len(program.states)} states; got "
            f"{run.table.size} and {run.state.size}; simulate the other models in a call of "
            "their own"
        )
    return rows
