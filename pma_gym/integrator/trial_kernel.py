"""Generate the function that simulates whole trials, one after the other in every lane."""

from llvmlite import ir

from pma_gym.codegen.graph import CHANGING
from pma_gym.codegen.machine.control import (
    DOUBLE,
    INTEGER,
    POINTER,
    Operand,
    atomic,
    function,
    integer,
    intrinsic,
    offset,
)
from pma_gym.codegen.machine.native import pairs
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.integrator.equations import COMMANDS, ZERO
from pma_gym.integrator.integration import FUSED, Lane, System, integrate_lanes, memory
from pma_gym.integrator.step_attempt import first_size

JOB = ("rows", "first_order_hold", "time", "motor", "regulator", "table", "start", "out")
"""Entries of a job of `simulate`: counts, then addresses. `start` holds the state vector, the size
of the first step and the contraction x0; `out` takes the states, one row a time."""


def write_simulate(module: ir.Module, system: System, width: int) -> None:
    """Write `simulate_1`, or of another width.

    It takes the number of jobs, the address of their entries (`JOB`), that of how many of them have
    been taken on, and that of an integer, in which it leaves how many steps were attempted. Threads
    that are given the same first three share the jobs: a lane that is free takes the next one.

    Args:
        module: where to write.
        system: equations and step, with commands that may change linearly in time.
        width: lanes.
    """
    eq, made = system.equations, system.attempt
    b, (count, jobs, taken, attempts) = function(
        module,
        f"simulate_{width}",
        [("count", INTEGER), ("jobs", POINTER), ("taken", POINTER), ("attempts", POINTER)],
    )
    simd = SimdEmitter(width, fused=FUSED, paired=pairs(width))
    lane = Lane(b, simd, system.layout)
    rows = memory(b, ir.ArrayType(INTEGER, width))
    n = len(eq.remembered)

    def entry(job: Operand, name: str) -> Operand:
        where = b.add(b.mul(job, integer(len(JOB))), integer(JOB.index(name)))
        return b.load(offset(b, jobs, where, INTEGER), typ=INTEGER)

    def address(job: Operand, name: str) -> Operand:
        return b.inttoptr(entry(job, name), POINTER)

    def at(job: Operand, name: str, row: Operand) -> Operand:
        return b.load(offset(b, address(job, name), row), typ=DOUBLE)

    jump = eq.graph.input("jump", CHANGING)
    first_step = first_size(made.size, jump)

    def begin_row(k: Operand, job: Operand, row: Operand) -> None:
        next_row = b.add(row, integer(1))
        duration = b.fsub(at(job, "time", next_row), at(job, "time", row))
        lane.put(made.left, k, duration)
        linear = b.icmp_signed("!=", entry(job, "first_order_hold"), integer(0))
        start = address(job, "start")
        known = {eq[ZERO].id: b.load(offset(b, start, n + 1), typ=DOUBLE)}
        moved: Operand = ir.Constant(DOUBLE, 0.0)
        for name, column in zip(COMMANDS, ("motor", "regulator"), strict=True):
            first, last = at(job, column, row), at(job, column, next_row)
            slope = b.fdiv(b.fsub(last, first), duration)
            known[eq.graph.input(f"{name}_slope", 1).id] = b.select(
                linear, slope, ir.Constant(DOUBLE, 0.0)
            )
            lane.put(eq[name], k, first)
            # A trial begins settled at its first commands: nothing jumps there.
            before = b.select(b.icmp_signed(">", row, integer(0)), b.sub(row, integer(1)), row)
            moves = intrinsic(b, "fabs", b.fsub(first, at(job, column, before)))
            larger = b.fcmp_ordered(">", moves, moved)
            moved = b.select(larger, moves, moved)
        size = lane.get(made.size, k)
        emitted = lane.one.emit(b, [first_step], {made.size.id: size, jump.id: moved})
        lane.put(made.size, k, b.select(linear, size, emitted[first_step.id]))
        lane.hold(k, known)
        b.store(row, offset(b, rows, k, INTEGER))

    def keep(k: Operand, job: Operand, row: Operand) -> None:
        out = offset(b, address(job, "out"), b.mul(row, integer(n)))
        for i, state in enumerate(eq.remembered):
            b.store(lane.get(state.value, k), offset(b, out, i))

    def take(k: Operand) -> Operand:
        job = b.atomic_rmw("add", atomic(b, taken), integer(1), "monotonic")
        is_job = b.icmp_signed("<", job, count)
        with b.if_then(is_job):
            b.store(job, lane.job(k))
            start = address(job, "start")
            for i, state in enumerate(eq.remembered):
                lane.put(state.value, k, b.load(offset(b, start, i), typ=DOUBLE))
            lane.put(made.size, k, b.load(offset(b, start, n), typ=DOUBLE))
            lane.tabulate(k, address(job, "table"))
            keep(k, job, integer(0))
            begin_row(k, job, integer(0))
        return is_job

    def proceed(k: Operand) -> Operand:
        job = b.load(lane.job(k), typ=INTEGER)
        row = b.add(b.load(offset(b, rows, k, INTEGER), typ=INTEGER), integer(1))
        keep(k, job, row)
        more = b.icmp_signed("<", row, b.sub(entry(job, "rows"), integer(1)))
        goes_on = memory(b, ir.IntType(1))
        b.store(ir.Constant(ir.IntType(1), 1), goes_on)
        with b.if_else(more) as (yes, no):
            with yes:
                begin_row(k, job, row)
            with no:
                b.store(lane.get(made.size, k), offset(b, address(job, "start"), n))
                b.store(take(k), goes_on)
        return b.load(goes_on, typ=ir.IntType(1))

    made_ones = integrate_lanes(lane, made, take, proceed)
    b.store(b.load(made_ones, typ=INTEGER), attempts)
    b.ret_void()
