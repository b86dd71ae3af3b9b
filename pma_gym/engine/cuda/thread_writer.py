"""Writes the control step for one thread an environment: for a GPU, and for its stand-in.

The arithmetic is the processor's own, by the same methods; only memory differs. A thread commands
and senses environments thread, thread + threads, and so on. In between, the threads of a warp share
the integrations of theirs: who is done takes the next, so that none waits long for a neighbour
whose steps are short.
"""

from typing import Protocol

from llvmlite import ir

from pma_gym.codegen.graph import HELD, Value
from pma_gym.codegen.machine.control import (
    DOUBLE,
    INDEX,
    INTEGER,
    Builder,
    Operand,
    integer,
    loop,
    offset,
    repeat,
)
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.trace import live_inputs
from pma_gym.engine.cpu.block_memory import narrowed, widened
from pma_gym.engine.cuda.reset_writer import CudaResetWriter
from pma_gym.engine.graph.scoring import Sampling
from pma_gym.integrator.integration import FUSED, memory


class Turns(Protocol):
    """Which environment a thread integrates next, and what threads of a warp do together."""

    def following(self, job: Operand) -> Operand:
        """Write the number of the environment after one; beyond the last if there is none."""
        ...

    def any(self, truth: Operand) -> Operand:
        """Write whether a truth holds for one of them."""
        ...

    def meet(self) -> None:
        """Write that they wait for each other."""
        ...


class ThreadWriter(CudaResetWriter):
    """Writes what a thread does; see `ThreadMemory`."""

    def step(
        self,
        b: Builder,
        given: dict[str, Operand],
        thread: Operand,
        threads: Operand,
        turns: Turns,
    ) -> None:
        """Write a control step of all environments of a thread."""
        with loop(b, given["count"], thread, threads) as job:
            self._command(b, given, job)
        turns.meet()
        self._integrate_all(b, given, thread, turns)
        turns.meet()
        ended = memory(b, INTEGER)
        b.store(integer(0), ended)
        with loop(b, given["count"], thread, threads) as job:
            self._sense(b, given, job, ended)

    def _action(self, b: Builder, given: dict[str, Operand], index: Operand, i: int) -> Operand:
        """An entry of an action; the last one again, and a sign of it, where it is not finite."""
        asked = super()._action(b, given, index, i)
        records, _ = self._block(b, given, index)
        before = b.load(self._cell(b, records, f"action_{i}", 0), typ=self.element)
        # Zero times a number that is not finite is none.
        nothing = b.fmul(asked, ir.Constant(self.element, 0.0))
        wrong = b.fcmp_unordered("uno", nothing, nothing)
        with b.if_then(wrong, likely=False):
            b.store(ir.Constant(INDEX, 1), given["faults"])
        return b.select(wrong, before, asked)

    def _integrate_all(
        self, b: Builder, given: dict[str, Operand], thread: Operand, turns: Turns
    ) -> None:
        simd, made = self._lanes(1), self.attempt
        cells = _Cells(b, self.element)
        kept = {name: self.step_graph.slot(name) for name in self.state_layout.states}
        kept["size"] = made.size
        job, attempts = memory(b, INTEGER), memory(b, INDEX)
        self._clock = memory(b, DOUBLE)
        b.store(ir.Constant(DOUBLE, 0.0), self._clock)
        b.store(thread, job)
        b.store(ir.Constant(INDEX, 0), attempts)

        def begin() -> None:
            now = b.load(job, typ=INTEGER)
            with b.if_then(b.icmp_signed("<", now, given["count"])):
                records, tables = self._block(b, given, now)
                for name in ("sample", *self.sums):
                    cells.put_vector(name, self._number(b, records, name))
                for name, value in kept.items():
                    cells.put(value, self._number(b, records, name))
                period = self.state_layout.options.period
                cells.put(made.left, ir.Constant(self.element, period))
                count = b.uitofp(self._count(b, self._cell(b, records, "count", 0)), DOUBLE)
                time = b.fmul(count, ir.Constant(DOUBLE, period))
                cells.put_vector("clock", narrowed(b, time, self.element))
                b.store(time, self._clock)
                known = self._fixed(b, simd, tables, 0)
                for name in self.state_layout.held:
                    if name in self.offsets:
                        known[self.step_graph.slot(name).id] = self._number(b, records, name)
                emitted = simd.emit(b, self.layout.held, known)
                for value in self.layout.held:
                    cells.put(value, emitted[value.id])

        def end() -> None:
            records, _ = self._block(b, given, b.load(job, typ=INTEGER))
            for name in ("sample", *self.sums):
                b.store(cells.vector(name), self._cell(b, records, name, 0))
            for name, value in kept.items():
                b.store(cells.get(value), self._cell(b, records, name, 0))
            b.store(turns.following(b.load(job, typ=INTEGER)), job)
            begin()

        begin()
        with repeat(b) as leave_if:
            now = b.load(job, typ=INTEGER)
            works = b.icmp_signed("<", now, given["count"])
            # Together, also those without work: else they would part for good.
            leave_if(b.not_(turns.any(works)))
            last = b.sub(given["count"], integer(1))
            _, tables = self._block(b, given, b.select(works, now, last))
            made_one = b.zext(works, INDEX)
            b.store(b.add(b.load(attempts, typ=INDEX), made_one), attempts)
            known = self._fixed(b, simd, tables, 0)
            for value in (*self.layout.changing, *self.layout.held):
                known[value.id] = cells.get(value)
            emitted = simd.emit(b, [*self.layout.outputs, *self.extra], known)
            with b.if_then(works):
                self._sample(b, simd, cells, emitted, given)
            for value, new in zip(self.layout.changing, self.layout.outputs, strict=True):
                cells.put(value, emitted[new.id])
            left = emitted[made.next_left.id]
            finished = b.fcmp_ordered("<=", left, ir.Constant(self.element, 0.0))
            with b.if_then(b.and_(works, finished)):
                end()
        b.store(b.load(attempts, typ=INDEX), offset(b, given["attempts"], thread, INDEX))

    def _exact_times(
        self, b: Builder, one: Sampling, known: dict[int, Operand]
    ) -> dict[int, Operand]:
        if not self.kernel.single:
            return {}
        wide = {value.id: known[value.id] for value in live_inputs([one.when])}
        wide = {i: widened(b, number) for i, number in wide.items()}
        wide[self.eq.graph.input("clock", HELD).id] = b.load(self._clock, typ=DOUBLE)
        # What an attempt's samples share is asked for, or it would be a part of each one's sum.
        emitted = SimdEmitter(1, fused=FUSED).emit(b, [one.done, one.when], wide)
        return {one.when.id: narrowed(b, emitted[one.when.id], self.element)}


class _Cells:
    """A thread's numbers during the integration: registers, once compiled."""

    def __init__(self, builder: Builder, element: ir.Type) -> None:
        self.builder, self.element = builder, element
        self._cells: dict[str | int, Operand] = {}

    def _cell(self, what: str | int) -> Operand:
        if what not in self._cells:
            self._cells[what] = memory(self.builder, self.element)
            with self.builder.goto_entry_block():
                self.builder.store(ir.Constant(self.element, 0.0), self._cells[what])
        return self._cells[what]

    def put(self, value: Value, number: Operand) -> None:
        self.put_vector(value.id, number)

    def get(self, value: Value) -> Operand:
        return self.vector(value.id)

    def put_vector(self, what: str | int, numbers: Operand) -> None:
        self.builder.store(numbers, self._cell(what))

    def vector(self, what: str | int) -> Operand:
        return self.builder.load(self._cell(what), typ=self.element)
