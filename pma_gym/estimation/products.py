"""Products of trials' residuals and their sensitivities, summed over rows, for a fit.

Written for compiled code because it reads many megabytes once, where array by array they would be
read and written several times, and because threads that call NumPy in between wait for each other.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.machine.control import (
    DOUBLE,
    INTEGER,
    POINTER,
    Builder,
    Module,
    Operand,
    function,
    integer,
    intrinsic,
    loop,
    offset,
    real,
)
from pma_gym.codegen.machine.native import compiled
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.threads.thread_pool import share

LANES = 8
"""Rows that are summed beside each other, whatever the processor: the bits depend on it."""

_JOB = ("rows", "tried", "moved", "channels", "signals", "scratch", "out")
"""Entries of a job: rows; how many courses of each signal; how many of them are moved parameters;
how many signals; then addresses of their entries, of memory to work in and of the result."""

_SIGNAL = ("step", "run", "simulated", "measured", "weights")
"""Entries of a signal: from one row to the next and from one course to the next, in numbers; then
addresses."""

Array = NDArray[np.float64]


@dataclass
class Signals:
    """Measured and simulated signals of a trial, for some parameters.

    Attributes:
        simulated: of each sensor: for the parameters, then with each of them moved, and with each
            moved the other way if all are; shape (tried, rows), with any strides.
        measured: of each, shape (rows,).
        weights: what differences of each are multiplied by; shape (rows,). Where one is 0 nothing
            counts.
        central: parameters are moved both ways.
    """

    simulated: Sequence[Array]
    measured: Sequence[Array]
    weights: Sequence[Array]
    central: bool


def products(trials: Sequence[Signals], threads: int = 1) -> list[Array]:
    """Compute the products of weighted residuals and their sensitivities with each other.

    Args:
        trials: sensors' courses.
        threads: number of threads; the bits do not depend on it.
    Returns:
        Of each trial a symmetric matrix of shape (1 + moved, 1 + moved), summed over its sensors.
    """
    jobs, kept, results = np.zeros((len(trials), len(_JOB)), np.int64), [], []
    for job, trial in zip(jobs, trials, strict=True):
        tried, rows = trial.simulated[0].shape
        moved = (tried - 1) // 2 if trial.central else tried - 1
        out, scratch = np.zeros((1 + moved,) * 2), np.empty(((1 + moved) * (4 + moved) // 2, LANES))
        entries = np.array(
            [
                (*(s // x.itemsize for s in x.strides[::-1]), *(a.ctypes.data for a in (x, y, w)))
                for x, y, w in zip(trial.simulated, trial.measured, trial.weights, strict=True)
            ]
        )
        addresses = (array.ctypes.data for array in (entries, scratch, out))
        job[:] = [rows, tried, moved, len(entries), *addresses]
        kept.append((trial, entries, scratch))
        results.append(out)
    library = compiled(["products"], _module, "products")
    multiply = library.function("products", [ctypes.c_int64, ctypes.c_void_p])
    parts = [np.ascontiguousarray(jobs[k::threads]) for k in range(threads)]
    share(lambda k: multiply(len(parts[k]), parts[k].ctypes.data), threads, (parts, kept, results))
    return results


def _module() -> Module:
    module = Module()
    b, (count, jobs) = function(module, "products", [("count", INTEGER), ("jobs", POINTER)])
    with loop(b, count) as number:
        job = offset(b, jobs, b.mul(number, integer(len(_JOB))), INTEGER)
        _multiply(b, _entries(b, job, _JOB))
    b.ret_void()
    return module


def _entries(b: Builder, table: Operand, names: Sequence[str]) -> dict[str, Operand]:
    """Contents of a table of entries, by name."""
    entries = {}
    for i, name in enumerate(names):
        entries[name] = b.load(offset(b, table, i, INTEGER), typ=INTEGER)
        if name in _ADDRESSES:
            entries[name] = b.inttoptr(entries[name], POINTER)
    return entries


_ADDRESSES = ("signals", "scratch", "out", "simulated", "measured", "weights")


def _multiply(b: Builder, arguments: dict[str, Operand]) -> None:
    """Write the products of one job; sums stand behind the differences in its scratch memory."""
    simd = SimdEmitter(LANES)
    scratch, rows = arguments["scratch"], arguments["rows"]
    size = b.add(arguments["moved"], integer(1))
    pairs = b.sdiv(b.mul(size, b.add(size, integer(1))), integer(2))
    with loop(b, pairs) as pair:
        simd.store(b, simd.constant(0.0), scratch, b.add(size, pair))
    with loop(b, rows, 0, LANES) as first, loop(b, arguments["channels"]) as channel:
        at = b.mul(channel, integer(len(_SIGNAL)))
        own = _entries(b, offset(b, arguments["signals"], at, INTEGER), _SIGNAL)
        _differ(b, simd, {**arguments, **own}, first, size)
        with loop(b, size) as i:
            one, start = simd.load(b, scratch, i), b.add(size, _before(b, i))
            with loop(b, b.add(i, integer(1))) as j:
                at = b.add(start, j)
                other, total = simd.load(b, scratch, j), simd.load(b, scratch, at)
                simd.store(b, intrinsic(b, "fma", one, other, total), scratch, at)
    with loop(b, size) as i, loop(b, b.add(i, integer(1))) as j:
        total = simd.load(b, scratch, b.add(b.add(size, _before(b, i)), j))
        parts = [simd.extract(b, total, k) for k in range(LANES)]
        while len(parts) > 1:
            parts = [b.fadd(one, other) for one, other in zip(parts[::2], parts[1::2], strict=True)]
        for row, column in ((i, j), (j, i)):
            b.store(parts[0], offset(b, arguments["out"], b.add(b.mul(row, size), column)))


def _before(b: Builder, row: Operand) -> Operand:
    """How many products lie before a row of the lower triangle."""
    return b.sdiv(b.mul(row, b.add(row, integer(1))), integer(2))


def _differ(
    b: Builder, simd: SimdEmitter, arguments: dict[str, Operand], first: Operand, size: Operand
) -> None:
    """Write the differences of some rows into scratch memory, weighted."""
    rows = [b.add(first, integer(k)) for k in range(LANES)]
    inside = [b.icmp_signed("<", row, arguments["rows"]) for row in rows]
    last = b.sub(arguments["rows"], integer(1))
    rows = [b.select(there, row, last) for row, there in zip(rows, inside, strict=True)]
    steps = [b.mul(row, arguments["step"]) for row in rows]
    none, half = real(0.0), simd.constant(0.5)

    def gathered(numbers: Sequence[Operand]) -> Operand:
        vector = simd.constant(0.0)
        for k, number in enumerate(numbers):
            vector = simd.insert(b, vector, number, k)
        return vector

    def column(name: str) -> list[Operand]:
        return [b.load(offset(b, arguments[name], row), typ=DOUBLE) for row in rows]

    def signal(number: Operand) -> Operand:
        start = offset(b, arguments["simulated"], b.mul(number, arguments["run"]))
        return gathered([b.load(offset(b, start, step), typ=DOUBLE) for step in steps])

    weighing = zip(column("weights"), inside, strict=True)
    weights = gathered([b.select(there, weight, none) for weight, there in weighing])
    counts = b.fcmp_ordered("!=", weights, simd.constant(0.0))

    def keep(number: Operand | int, difference: Operand) -> None:
        # What counts for nothing may be no number.
        weighted = b.select(counts, b.fmul(difference, weights), simd.constant(0.0))
        simd.store(b, weighted, arguments["scratch"], number)

    as_it_is = signal(integer(0))
    keep(0, b.fsub(as_it_is, gathered(column("measured"))))
    is_central = b.icmp_signed(">", arguments["tried"], size)
    with loop(b, size, 1) as k:
        moved = signal(k)
        with b.if_else(is_central) as (both, forwards):
            with both:
                back = signal(b.add(k, arguments["moved"]))
                keep(k, b.fmul(half, b.fsub(moved, back)))
            with forwards:
                keep(k, b.fsub(moved, as_it_is))
