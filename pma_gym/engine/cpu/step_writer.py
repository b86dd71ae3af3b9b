"""Writes the control step of environments: command, integration, sensors, reward."""

from collections.abc import Callable
from contextlib import nullcontext

from llvmlite import ir

from pma_gym.codegen.generic import to_real
from pma_gym.codegen.graph import FIXED, HELD
from pma_gym.codegen.machine.control import (
    DOUBLE,
    INTEGER,
    POINTER,
    Builder,
    Operand,
    function,
    integer,
    loop,
    offset,
    repeat,
    variable,
)
from pma_gym.codegen.machine.native import pairs
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.threads.thread_pool import write_another
from pma_gym.codegen.trace import split
from pma_gym.engine.cpu.block_memory import BEFORE, KernelSpec, narrowed, widened
from pma_gym.engine.cpu.python_step import write_python_step
from pma_gym.engine.cpu.reset_writer import ResetWriter
from pma_gym.engine.graph.scoring import COURSE, Course, course, sampling
from pma_gym.integrator.integration import FUSED, Lane, Layout, integrate_lanes, memory
from pma_gym.integrator.step_attempt import step_attempt

BAD_ACTION = 4
"""What `check` returns where an action is no finite number: there `step` is not to be called."""


class Writer(ResetWriter):
    """Writes a kernel's module."""

    def __init__(self, kernel: KernelSpec) -> None:
        super().__init__(kernel)
        self.attempt = step_attempt(self.eq, kernel.program.model.rig.position_tolerances)
        self.course: Course = course(self.eq, self.attempt, self.step_graph.followed)
        extra = [*self.course.values, self.attempt.accepted, self.attempt.length]
        layout = Layout.of(self.attempt, extra)
        self.extra = extra
        self.commanded = self.step_graph.command()
        self.sensed = self.step_graph.sense(self.step_graph.slot("count") + 1, first=False)
        self.sensed["reward"] = self.step_graph.reward(self.sensed)
        later = [*self.sensed.values(), *self._trace_reset()]
        self._prepare()
        fixed = {v.id: v for v in [*layout.fixed, *split(later, FIXED)]}
        self.fixed = [fixed[i] for i in sorted(fixed)]
        self.layout = Layout(layout.changing, layout.outputs, layout.held, layout.fixed, self.fixed)
        self._write()

    def _prepare(self) -> None:
        """Decide what follows from all that is computed."""

    def _write(self) -> None:
        self._table()
        self._check()
        self._step()
        self._begin()
        if self.width == 1:
            write_python_step(self.module, self.state_layout)

    def _table(self) -> None:
        b, (vector, out) = function(self.module, "table", [("vector", POINTER), ("out", POINTER)])
        known = self.kernel.program.parameters(b, vector, self.fixed)
        emitted = SimdEmitter(1).emit(b, self.fixed, known)
        for i, value in enumerate(self.fixed):
            b.store(emitted[value.id], offset(b, out, i))
        b.ret_void()
        b, _ = function(self.module, "table_size", [], INTEGER)
        b.ret(integer(len(self.fixed)))

    # -- a step ------------------------------------------------------------------------------------

    def _check(self) -> None:
        """Whether all actions are finite, which a step takes for granted."""
        b, (arguments,) = function(self.module, "check", [("arguments", POINTER)], INTEGER)
        given = self._arguments(b, arguments)
        bad, simd = memory(b, INTEGER), SimdEmitter(self.width)
        b.store(integer(0), bad)
        with loop(b, given["last"], given["first"]) as block:
            for i in range(self.state_layout.actions):
                action = self._actions(b, simd, given, block, i)
                # Zero times a number that is not finite is none.
                nothing = b.fmul(action, simd.constant(0.0))
                wrong = simd.any(b, b.fcmp_unordered("uno", nothing, nothing))
                b.store(b.or_(b.load(bad, typ=INTEGER), b.zext(wrong, INTEGER)), bad)
        b.ret(b.mul(b.load(bad, typ=INTEGER), integer(BAD_ACTION)))

    def _step(self) -> None:
        """Step a part of the blocks, and what other parts the thread takes meanwhile."""
        b, (part,) = function(self.module, "command", [("part", POINTER)])
        given = self._arguments(b, part)
        with loop(b, given["last"], given["first"]) as block:
            self._command(b, given, block)
        b.ret_void()
        both = [("part", POINTER), ("pool", POINTER)]
        b, (part, pool) = function(self.module, "step", both, INTEGER)
        b.call(self.module.get_global("command"), [part])
        b.store(integer(0), offset(b, part, BEFORE, INTEGER))
        newest = variable(b, INTEGER, b.ptrtoint(part, INTEGER))
        given = self._arguments(b, part)
        self._integrate(b, given, lambda: self._take_part(b, pool, newest))
        ended = memory(b, INTEGER)
        b.store(integer(0), ended)
        with repeat(b) as leave_if:
            address = b.load(newest, typ=INTEGER)
            leave_if(b.icmp_signed("==", address, integer(0)))
            part = b.inttoptr(address, POINTER)
            given = self._arguments(b, part)
            with loop(b, given["last"], given["first"]) as block:
                self._sense(b, given, block, ended)
            b.store(b.load(offset(b, part, BEFORE, INTEGER), typ=INTEGER), newest)
        b.ret(b.load(ended, typ=INTEGER))

    def _take_part(self, b: Builder, pool: Operand, newest: Operand) -> tuple[Operand, Operand]:
        """Take another part, if there is one, and command it; its first job and the one behind."""
        first, stop = variable(b, INTEGER, integer(0)), variable(b, INTEGER, integer(0))
        address = write_another(b, pool)
        with b.if_then(b.icmp_signed("!=", address, integer(0))):
            part = b.inttoptr(address, POINTER)
            b.store(b.load(newest, typ=INTEGER), offset(b, part, BEFORE, INTEGER))
            b.store(address, newest)
            b.call(self.module.get_global("command"), [part])
            given = self._arguments(b, part)
            # Whoever took the first part counts them all.
            b.store(integer(0), given["attempts"])
            for place, job in zip((first, stop), self._jobs(b, given), strict=True):
                b.store(job, place)
        return b.load(first, typ=INTEGER), b.load(stop, typ=INTEGER)

    def _jobs(self, b: Builder, given: dict[str, Operand]) -> tuple[Operand, Operand]:
        """The first environment of a part, and the one behind the last."""
        first, last = (b.mul(given[name], integer(self.width)) for name in ("first", "last"))
        return first, b.select(b.icmp_signed("<", last, given["count"]), last, given["count"])

    def _action(self, b: Builder, given: dict[str, Operand], index: Operand, i: int) -> Operand:
        at = b.add(b.mul(index, integer(self.state_layout.actions)), integer(i))
        return b.load(offset(b, given["actions"], at, self.element), typ=self.element)

    def _actions(
        self, b: Builder, simd: SimdEmitter, given: dict[str, Operand], block: Operand, i: int
    ) -> Operand:
        first = b.mul(block, integer(self.width))
        return self._gathered(
            b,
            simd,
            [self._action(b, given, b.add(first, integer(k)), i) for k in range(self.width)],
        )

    def _command(self, b: Builder, given: dict[str, Operand], block: Operand) -> None:
        simd = self._lanes(self.width)
        records, tables = self._block(b, given, block)
        values = list(self.commanded.values())
        known = self._known(b, simd, values, records, tables, 0)
        for i in range(self.state_layout.actions):
            known[self.step_graph.action(i).id] = self._actions(b, simd, given, block, i)
        emitted = simd.emit(b, values, known)
        self._store(b, simd, emitted, self.commanded, records, 0)

    def _integrate(
        self,
        b: Builder,
        given: dict[str, Operand],
        take_part: Callable[[], tuple[Operand, Operand]],
    ) -> None:
        real, paired = "float" if self.kernel.single else "double", pairs(self.width)
        simd = SimdEmitter(self.width, real, FUSED, paired)
        sums = [f"sum_{phase.name}" for phase in self.state_layout.task.schedule.phases]
        lane = Lane(b, simd, self.layout, ["clock", "sample", *sums])
        period = self.state_layout.options.period
        following, behind = (variable(b, INTEGER, job) for job in self._jobs(b, given))
        kept = [*self.state_layout.states, "size"]
        values = {name: self.step_graph.slot(name) for name in self.state_layout.states}
        values["size"] = self.attempt.size
        own = ["sample", *sums]

        def address(job: Operand, name: str) -> Operand:
            block, k = b.sdiv(job, integer(self.width)), b.srem(job, integer(self.width))
            return self._place(b, given["records"], block, name, k)

        def number(job: Operand, name: str) -> Operand:
            return b.load(address(job, name), typ=DOUBLE)

        def is_left() -> Operand:
            return b.icmp_signed("<", b.load(following, typ=INTEGER), b.load(behind, typ=INTEGER))

        def take(k: Operand, again: bool = False) -> Operand:
            if self.width > 1:
                with b.if_then(b.not_(is_left())):
                    for place, job in zip((following, behind), take_part(), strict=True):
                        b.store(job, place)
            is_next, job = is_left(), b.load(following, typ=INTEGER)
            with b.if_then(is_next):
                b.store(b.add(job, integer(1)), following)
                b.store(job, lane.job(k))
                if self.width == 1:
                    steps = b.load(address(job, "count"), typ=INTEGER)
                    voltage = number(job, self.state_layout.recorded)
                    b.store(voltage, offset(b, given["voltages"], steps))
                for name in kept:
                    lane.put(values[name], k, lane.narrow(number(job, name)))
                for name in own:
                    lane.put(name, k, lane.narrow(number(job, name)))
                lane.put(self.attempt.left, k, ir.Constant(simd.element, period))
                steps = b.load(address(job, "count"), typ=INTEGER)
                time = b.fmul(b.uitofp(steps, DOUBLE), ir.Constant(DOUBLE, period))
                lane.put("clock", k, lane.narrow(time))
                inputs = {
                    self.step_graph.slot(name).id: lane.narrow(number(job, name))
                    for name in self.state_layout.held
                }
                block, rest = b.sdiv(job, integer(self.width)), b.srem(job, integer(self.width))
                _, tables = self._block(b, given, block)
                # A lane that has worked has the table already if all share one.
                stale = b.icmp_signed("!=", given["table_stride"], integer(0))
                with b.if_then(stale) if again else nullcontext():
                    lane.tabulate(k, offset(b, tables, rest), self.width)
                lane.hold(k, inputs)
            return is_next

        def proceed(k: Operand) -> Operand:
            job = b.load(lane.job(k), typ=INTEGER)
            for name in kept:
                b.store(lane.widen(lane.get(values[name], k)), address(job, name))
            for name in own:
                b.store(lane.widen(lane.get(name, k)), address(job, name))
            return take(k, again=True)

        def watch(emitted: dict[int, Operand]) -> None:
            self._sample(b, simd, lane, emitted, given)

        made = integrate_lanes(lane, self.attempt, take, proceed, watch, self.extra)
        b.store(b.load(made, typ=INTEGER), given["attempts"])

    def _sample(
        self,
        b: Builder,
        simd: SimdEmitter,
        lane: Lane,
        emitted: dict[int, Operand],
        given: dict[str, Operand],
    ) -> None:
        """Take every sample that lies in the attempt."""
        options, task = self.state_layout.options, self.state_layout.task
        one = sampling(self.eq.graph, self.attempt.left, task, options.period)
        graph = self.eq.graph
        known = {self.attempt.left.id: emitted[self.attempt.left.id]}
        for name, value in zip(COURSE, self.course.values, strict=True):
            known[graph.input(f"course.{name}", 2).id] = emitted[value.id]
        known[graph.input("length", 2).id] = emitted[self.attempt.length.id]
        known[graph.input("accepted", 2, "truth").id] = emitted[self.attempt.accepted.id]
        known[graph.input("clock", HELD).id] = lane.vector("clock")
        phases = task.schedule.phases
        with repeat(b) as leave_if:
            for name in ("sample", *(f"sum_{phase.name}" for phase in phases)):
                known[graph.input(f"record.{name}", 2).id] = lane.vector(name)
            known |= self._exact_times(b, one, known)
            outputs = [one.due, one.position, one.sample, *one.sums]
            if one.ideal is not None:
                # Whoever passes no sample looks nothing up.
                known = simd.emit(b, [one.due], known)
                leave_if(b.not_(simd.any(b, known[one.due.id])))
                known[one.ideal.id] = self._ideals(b, simd, lane, given)
            sampled = simd.emit(b, outputs, known)
            if one.ideal is None:
                leave_if(b.not_(simd.any(b, sampled[one.due.id])))
            if self.traces:
                number = known[graph.input("record.sample", 2).id]
                index = b.fptoui(simd.extract(b, number, 0), INTEGER)
                where = offset(b, given["trace"], index)
                b.store(widened(b, simd.extract(b, sampled[one.position.id], 0)), where)
            lane.put_vector("sample", sampled[one.sample.id])
            for phase, value in zip(phases, one.sums, strict=True):
                lane.put_vector(f"sum_{phase.name}", sampled[value.id])

    def _ideals(
        self, b: Builder, simd: SimdEmitter, lane: Lane, given: dict[str, Operand]
    ) -> Operand:
        """Ideal position at the next sample of every lane, from the table of its environment."""
        ideals, samples = [], lane.vector("sample")
        for k in range(simd.width):
            job = b.load(lane.job(k), typ=INTEGER)
            # A lane without a job looks up what any environment has.
            at = b.select(b.icmp_signed("<", job, integer(0)), integer(0), job)
            index = b.fptoui(simd.extract(b, samples, k), INTEGER)
            index = b.add(index, b.mul(at, given["reference_stride"]))
            where = offset(b, given["ideals"], index, self.element)
            ideals.append(narrowed(b, b.load(where, typ=self.element), simd.element))
        return self._gathered(b, simd, ideals)

    # -- what comes of it --------------------------------------------------------------------------

    def _sense(self, b: Builder, given: dict[str, Operand], block: Operand, ended: Operand) -> None:
        simd = self._lanes(self.width)
        records, tables = self._block(b, given, block)
        first = b.mul(block, integer(self.width))
        entries = self.step_graph.observation(self.kernel.observed, self.sensed)
        options = self.state_layout.options
        is_over = self.sensed["ended"] > 0.0
        at_end = to_real(self.sensed["count"]) >= self.step_graph.horizon
        truncated = at_end & ~is_over
        values = [*self.sensed.values(), *entries, is_over, truncated]
        known = self._known(b, simd, values, records, tables, 0)
        horizon = simd.spread(b, b.uitofp(given["horizon"], simd.element))
        known[self.step_graph.horizon.id] = horizon
        for steps_ahead in range(options.preview + 1):
            known[self.step_graph.reference(steps_ahead).id] = self._references(
                b, simd, given, records, 0, first, steps_ahead, 1
            )
        emitted = simd.emit(b, values, known)
        self._store(b, simd, emitted, self.sensed, records, 0)
        self._put_observation(b, simd, given, emitted, entries, first)
        for k in range(self.width):
            index = b.add(first, integer(k))
            reward = simd.extract(b, emitted[self.sensed["reward"].id], k)
            b.store(reward, offset(b, given["rewards"], index, self.element))
            for name, truth in (("terminated", is_over), ("truncated", truncated)):
                flag = b.zext(simd.extract(b, emitted[truth.id], k), ir.IntType(8))
                b.store(flag, offset(b, given[name], index, ir.IntType(8)))
        # SimdEmitter beyond the last environment never end: their records are copies of a rest.
        any_over = b.zext(simd.any(b, emitted[is_over.id]), INTEGER)
        any_end = b.zext(simd.any(b, emitted[truncated.id]), INTEGER)
        both = b.or_(any_over, b.shl(any_end, integer(1)))
        b.store(b.or_(b.load(ended, typ=INTEGER), both), ended)
