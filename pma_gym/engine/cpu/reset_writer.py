"""Code of resets: pressure and equilibrium, the sensors' zero, the first observation."""

from llvmlite import ir

from pma_gym.codegen.graph import Value
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
)
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.random import philox, uniform
from pma_gym.codegen.trace import substitute
from pma_gym.engine.cpu.block_memory import BlockMemory, KernelSpec, narrowed, widened
from pma_gym.engine.state_layout import DRAW, TARE
from pma_gym.integrator.integration import FUSED, memory
from pma_gym.plant.program import FIRST_S, balanced, memories_at_start, static_force

TARE_READINGS = 192
"""Readings at rest whose mean is the sensors' zero: half a second at 384 Hz, as one would do."""

_AT_REST = {
    "contraction": "zero",
    "pressure": "pressure",
    "lag_lvdt": "zero",
    "lag_pressure_transducer": "pressure",
}
"""States that are not 0 where the cable hangs slack.

See `pma_gym.plant.equilibrium.solver.NoLoadEquilibria`."""


class ResetWriter(BlockMemory):
    """Write the code of resets.

    Attributes:
        module: where to.
        traces: whether a single environment's course is written down.
        begun: what the first sample gives, by name.
        tare: readings at rest.
    """

    def __init__(self, kernel: KernelSpec) -> None:
        super().__init__(kernel)
        self.module = ir.Module()
        self.traces = kernel.width == 1

    def _trace_reset(self) -> list[Value]:
        """Trace what a beginning computes; returns it, for its part of the table."""
        step_graph, graph = self.step_graph, self.eq.graph
        self.begun = step_graph.sense(step_graph.slot("count"), first=True)
        self.begun |= step_graph.first_score(self.begun)
        self.first_position = step_graph.position(self.begun)
        self.tare = step_graph.read(TARE, graph.input("reading", 2, "integer"))
        first = [*self.begun.values(), self.first_position, *self.tare]
        return [*first, *self._trace_rest()] if self.kernel.draws else first

    def _trace_rest(self) -> list[Value]:
        eq = self.eq
        (self.force,) = substitute([static_force(eq)], {})
        limits, line = eq.parameters["limits"], eq.parameters["regulator_line"]
        self.reach = [limits.stretch, limits.contraction]
        self.line = [line.gain, line.offset]
        nothing = eq.graph.constant(0, "integer")
        keys = self.step_graph.slot("key_0"), self.step_graph.slot("key_1")
        stream = self.step_graph.slot("episode") * 4 + DRAW
        self.share = uniform(philox((nothing, stream, nothing, nothing), keys)[0])
        self.memories = memories_at_start(eq)
        return [self.force, *self.reach, *self.line, *self.memories.values()]

    def _begin(self) -> None:
        """Begin trials of environments, at rest wherever their states are not set already.

        It is a function for a `ThreadPool`, which takes no other part itself.
        """
        both = [("arguments", POINTER), ("crew", POINTER)]
        b, (arguments, _) = function(self.module, "begin", both, INTEGER)
        given = self._arguments(b, arguments)
        simd = SimdEmitter(1, fused=FUSED)
        settles = b.icmp_signed("!=", given["settles"], integer(0))
        with loop(b, given["last"], given["first"]) as row:
            index = b.load(offset(b, given["indices"], row, INTEGER), typ=INTEGER)
            lane = b.srem(index, integer(self.width))
            records, tables = self._block(b, given, b.sdiv(index, integer(self.width)))
            if self.kernel.draws:
                with b.if_then(settles):
                    self._settle(b, given, records, tables, lane, row)
            self._zero_sensors(b, records, tables, lane)
            self._first(b, simd, given, records, tables, lane, index)
        b.ret(integer(0))

    def _settle(
        self,
        b: Builder,
        given: dict[str, Operand],
        records: Operand,
        tables: Operand,
        lane: Operand,
        row: Operand,
    ) -> None:
        """Draw a pressure, find the rest there and write it down; in double precision."""
        exact = SimdEmitter(1)
        known = self._fixed(b, exact, tables, lane)
        before = self._count(b, self._cell(b, records, "episode", lane))
        episode = b.and_(b.add(before, integer(1)), integer(0xFFFFFFFF))
        drawn = {self.step_graph.slot("episode").id: episode}
        for name in ("key_0", "key_1"):
            key = self._count(b, self._cell(b, records, name, lane))
            drawn[self.step_graph.slot(name).id] = key
        share = exact.emit(b, [self.share], drawn)[self.share.id]
        pressure = self._pressure(b, given, share, row)
        gain, start = (known[value.id] for value in self.line)
        regulator = b.fdiv(b.fsub(pressure, start), gain)
        known[self.eq["pressure"].id] = pressure
        reach = [known[value.id] for value in self.reach]
        none = ir.Constant(DOUBLE, 0.0)
        zero = balanced(b, self.eq, self.force, known, none, reach)
        rest_values = {"zero": zero, "pressure": pressure}
        real = {name: rest_values[what] for name, what in _AT_REST.items()}
        real |= {name: known[value.id] for name, value in self.memories.items()}
        real |= {"zero_contraction": zero, "size": ir.Constant(DOUBLE, FIRST_S)}
        real |= {"regulator_voltage": regulator, "rest_regulator": regulator}
        real |= self._asked_before(b, regulator)
        whole = {"episode": episode, "count": integer(0)}
        for name in self.offsets:
            where = self._cell(b, records, name, lane)
            if name in whole:
                self._keep(b, exact, whole[name], where, "integer")
            elif self.state_layout.kind(name) == "real":
                b.store(narrowed(b, real.get(name, none), self.element), where)

    def _pressure(
        self, b: Builder, given: dict[str, Operand], share: Operand, row: Operand
    ) -> Operand:
        """Gauge pressure (Pa) for a number between 0 and 1, in the range given for a row."""
        low, high = (
            b.load(
                offset(b, given["pressures"], b.add(b.mul(row, integer(2)), integer(i))), typ=DOUBLE
            )
            for i in range(2)
        )
        return b.fadd(low, b.fmul(share, b.fsub(high, low)))

    def _asked_before(self, b: Builder, regulator: Operand) -> dict[str, Operand]:
        """Actions and volts on the wire before the first step, as if the station had been held."""
        share = b.fmul(ir.Constant(DOUBLE, 0.2), regulator)
        action = b.fsub(share, ir.Constant(DOUBLE, 1.0))
        for sign, bound in (("<", -1.0), (">", 1.0)):
            end = ir.Constant(DOUBLE, bound)
            action = b.select(b.fcmp_ordered(sign, action, end), end, action)
        commands = {}
        actions = ir.Constant(DOUBLE, -1.0), action
        volts = ir.Constant(DOUBLE, 0.0), regulator
        for i in range(self.state_layout.actions):
            commands[f"action_{i}"] = actions[i]
            for k in range(self.state_layout.options.action_delay):
                commands[f"wire_{k}_{i}"] = volts[i]
        return commands

    def _zero_sensors(self, b: Builder, records: Operand, tables: Operand, lane: Operand) -> None:
        """Read the sensors at rest, some readings at once.

        They are summed in their order, so that no bit depends on how many these are.
        """
        readings = TARE_READINGS if self.state_layout.options.noise else 1
        abreast = self._lanes(self.kernel.abreast if readings > 1 else 1)
        assert readings % abreast.width == 0
        own = self._known(b, self._lanes(1), self.tare, records, tables, lane)
        known = {i: abreast.spread(b, number) for i, number in own.items()}
        totals = [memory(b, DOUBLE) for _ in range(2)]
        for total in totals:
            b.store(ir.Constant(DOUBLE, 0.0), total)
        with loop(b, readings, step=abreast.width) as first:
            number = b.add(abreast.spread(b, first), abreast.numbers)
            known[self.eq.graph.input("reading", 2, "integer").id] = number
            emitted = abreast.emit(b, self.tare, known)
            for total, value in zip(totals, self.tare[:2], strict=True):
                sum_ = b.load(total, typ=DOUBLE)
                for k in range(abreast.width):
                    sum_ = b.fadd(sum_, widened(b, abreast.extract(b, emitted[value.id], k)))
                b.store(sum_, total)
        for total, name in zip(totals, ("tare_contraction", "tare_rotation"), strict=True):
            mean = b.fmul(b.load(total, typ=DOUBLE), ir.Constant(DOUBLE, 1.0 / readings))
            b.store(narrowed(b, mean, self.element), self._cell(b, records, name, lane))

    def _first(
        self,
        b: Builder,
        simd: SimdEmitter,
        given: dict[str, Operand],
        records: Operand,
        tables: Operand,
        lane: Operand,
        index: Operand,
    ) -> None:
        options = self.state_layout.options
        entries = self.step_graph.observation(self.kernel.observed, self.begun)
        values = [*self.begun.values(), self.first_position, *entries]
        known = self._known(b, simd, values, records, tables, lane)
        for steps_ahead in range(options.preview + 1):
            known[self.step_graph.reference(steps_ahead).id] = self._references(
                b, simd, given, records, lane, index, steps_ahead, 0
            )
        emitted = simd.emit(b, values, known)
        self._store(b, simd, emitted, self.begun, records, lane)
        if self.traces:
            b.store(widened(b, emitted[self.first_position.id]), given["trace"])
        self._put_observation(b, simd, given, emitted, entries, index)
