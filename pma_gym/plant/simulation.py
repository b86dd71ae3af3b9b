"""Simulation of many trials at once."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pma_gym.codegen.threads.sharing import share
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
    wide = len(runs) >= FEW
    kernel = program.simulate_many if wide else program.simulate_one
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
        given = map(address, (run.time, run.motor, run.regulator, run.table))
        jobs[i] = (
            rows,
            run.interpolation == "foh",
            *given,
            where + i * apart,
            run.states.ctypes.data,
        )
        if rows == 1:
            run.states[0] = run.state
    # The longest first, so that the last lanes do not wait for one of them.
    order = np.argsort([-len(run.time) for run in runs], kind="stable")
    long = np.ascontiguousarray(jobs[[i for i in order if len(runs[i].time) > 1]])
    taken, made = np.zeros(8, np.int64), np.zeros((threads, 8), np.int64)

    def work(k: int) -> None:
        kernel(len(long), long.ctypes.data, taken.ctypes.data, made[k].ctypes.data)

    share(work, threads, (known, starts, runs))
    for run, size in zip(runs, starts[:, count].tolist(), strict=True):
        run.size = size
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
