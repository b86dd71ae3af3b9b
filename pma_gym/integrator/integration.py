"""Integrate many plants at once, one per SIMD lane, each with its own adaptive step size.

A lane at the end of its span takes the next piece of work at once, so that lanes with short steps
delay no other, and the result of a plant depends on no other plant.

A model's equations with the arithmetic of one step, and their values at its start.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from llvmlite import ir

from pma_gym.codegen.graph import FIXED, HELD, Value
from pma_gym.codegen.machine.control import (
    DOUBLE,
    INTEGER,
    POINTER,
    Builder,
    Operand,
    integer,
    loop,
    offset,
    repeat,
    variable,
)
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.trace import split, substitute
from pma_gym.integrator.equations import COMMANDS, Equations
from pma_gym.integrator.step_attempt import StepAttempt

FUSED = True
"""Products and sums are rounded once, as IEEE 754 has it (fused multiply-add), and a sum's terms
are added as they come to be there: the same bits at every width and on every machine, and a third
faster."""


@dataclass(frozen=True)
class Layout:
    """Memory layout of a lane.

    Attributes:
        changing: values that an attempt changes: states and memories, size, left.
        outputs: what becomes of them.
        held: values that are fixed for a span.
        fixed: values that are fixed for a model.
        table: where those stand in memory: themselves, among what else is fixed for a model.
    """

    changing: list[Value]
    outputs: list[Value]
    held: list[Value]
    fixed: list[Value]
    table: list[Value]

    @classmethod
    def of(cls, attempt: StepAttempt, extra: Sequence[Value] = ()) -> "Layout":
        """The layout of an attempt, and of other values that are computed beside it."""
        outputs = [*attempt.states, attempt.next_size, attempt.next_left]
        both = [*outputs, *extra]
        fixed = split(both, FIXED)
        return cls(
            changing=[*attempt.before, attempt.size, attempt.left],
            outputs=outputs,
            held=[value for value in split(both, HELD) if value.level == HELD],
            fixed=fixed,
            table=fixed,
        )

    @property
    def slots(self) -> list[Value]:
        """All of a lane's values."""
        return [*self.changing, *self.held, *self.fixed]


class Lane:
    """The lanes' memory while code is written that works on one lane.

    Args:
        builder: where to write.
        simd: width and type.
        layout: what a lane works on.
        own: further numbers that a lane keeps, by name.
    """

    def __init__(
        self, builder: Builder, simd: SimdEmitter, layout: Layout, own: Sequence[str] = ()
    ) -> None:
        self.builder, self.simd, self.layout = builder, simd, layout
        self.at = {value.id: i for i, value in enumerate(layout.slots)}
        self.own = {name: len(self.at) + i for i, name in enumerate(own)}
        size = len(self.at) + len(own)
        self.memory = memory(builder, ir.ArrayType(simd.real, size))
        self.jobs = memory(builder, ir.ArrayType(INTEGER, simd.width))
        self.one = SimdEmitter(1, {8: "double", 4: "float"}[simd.size], FUSED)

    def slot(self, what: Value | str) -> int:
        """Place of a value or of a number by name."""
        return self.own[what] if isinstance(what, str) else self.at[what.id]

    def cell(self, what: Value | str, lane: Operand | int) -> Operand:
        """Address of a lane's number."""
        first = integer(self.slot(what) * self.simd.elements)
        where = self.builder.add(first, integer(lane))
        return offset(self.builder, self.memory, where, self.simd.element)

    def put(self, what: Value | str, lane: Operand | int, number: Operand) -> None:
        """Write a lane's number."""
        if self.simd.width == 1:
            self.put_vector(what, self.simd.spread(self.builder, number))
        else:
            self.builder.store(number, self.cell(what, lane))

    def get(self, what: Value | str, lane: Operand | int) -> Operand:
        """Read a lane's number."""
        return self.builder.load(self.cell(what, lane), typ=self.simd.element)

    def vector(self, what: Value | str) -> Operand:
        """All lanes' numbers."""
        return self.simd.load(self.builder, self.memory, self.slot(what))

    def put_vector(self, what: Value | str, numbers: Operand) -> None:
        """Write all lanes' numbers."""
        self.simd.store(self.builder, numbers, self.memory, self.slot(what))

    def narrow(self, number: Operand) -> Operand:
        """A number in double precision as the lanes have it."""
        single = self.simd.element is not DOUBLE
        return self.builder.fptrunc(number, self.simd.element) if single else number

    def widen(self, number: Operand) -> Operand:
        """A lane's number in double precision."""
        single = self.simd.element is not DOUBLE
        return self.builder.fpext(number, DOUBLE) if single else number

    def job(self, lane: Operand | int) -> Operand:
        """Address of the number of a lane's job; negative for none."""
        return offset(self.builder, self.jobs, integer(lane), INTEGER)

    def tabulate(self, lane: Operand, table: Operand, spacing: int = 1) -> None:
        """Write what is fixed for a model: the table's numbers.

        Args:
            lane: number of the lane.
            table: address of the model's table, numbers in double precision.
            spacing: how many numbers lie from one of the table to the next.
        """
        offsets = {value.id: i for i, value in enumerate(self.layout.table)}
        for value in self.layout.fixed:
            where = offset(self.builder, table, offsets[value.id] * spacing)
            self.put(value, lane, self.narrow(self.builder.load(where, typ=DOUBLE)))

    def hold(self, lane: Operand, inputs: dict[int, Operand]) -> None:
        """Write what follows for a span, once the table is there.

        Args:
            lane: number of the lane.
            inputs: inputs of level HELD, by id.
        """
        known = {value.id: self.get(value, lane) for value in self.layout.fixed} | inputs
        emitted = self.one.emit(self.builder, self.layout.held, known)
        for value in self.layout.held:
            self.put(value, lane, emitted[value.id])


def memory(builder: Builder, type_: ir.Type) -> Operand:
    """Memory of a function, behind a plain pointer."""
    made = variable(builder, type_)
    made.type = POINTER
    return made


def integrate_lanes(
    lane: Lane,
    attempt: StepAttempt,
    take: Callable[[Operand], Operand],
    proceed: Callable[[Operand], Operand],
    watch: Callable[[dict[int, Operand]], None] | None = None,
    extra: Sequence[Value] = (),
) -> Operand:
    """Write the integration loop.

    Args:
        lane: the lanes.
        attempt: the attempt at a step.
        take: writes how a lane takes its first work; returns whether it found any.
        proceed: writes what a lane does at the end of a span; returns whether it goes on.
        watch: writes what is to be seen of an attempt, from all that it computes, before the lanes
            move on.
        extra: what else is computed for it.
    Returns:
        Address of how many attempts were made, all lanes at once.
    """
    b, simd, layout = lane.builder, lane.simd, lane.layout
    active = memory(b, INTEGER)
    attempts = memory(b, INTEGER)
    b.store(integer(0), active)
    b.store(integer(0), attempts)
    zero = ir.Constant(simd.element, 0.0)
    with loop(b, simd.width) as k:
        # Numbers that an idle lane can be computed with, whatever they mean.
        for i in range(len(lane.at) + len(lane.own)):
            where = b.add(integer(i * simd.elements), k)
            b.store(zero, offset(b, lane.memory, where, simd.element))
        has_work = take(k)
        b.store(b.select(has_work, b.load(lane.job(k), typ=INTEGER), integer(-1)), lane.job(k))
        b.store(b.add(b.load(active, typ=INTEGER), b.zext(has_work, INTEGER)), active)
    with repeat(b) as leave_if:
        leave_if(b.icmp_signed("<=", b.load(active, typ=INTEGER), integer(0)))
        b.store(b.add(b.load(attempts, typ=INTEGER), integer(1)), attempts)
        known = {value.id: lane.vector(value) for value in layout.slots}
        emitted = simd.emit(b, [*layout.outputs, *extra], known)
        if watch is not None:
            watch(emitted)
        for value, new in zip(layout.changing, layout.outputs, strict=True):
            lane.put_vector(value, emitted[new.id])
        left = emitted[attempt.next_left.id]
        finished = b.fcmp_ordered("<=", left, simd.constant(0.0))
        with b.if_then(simd.any(b, finished)):
            with loop(b, simd.width) as k:
                there = b.icmp_signed(">=", b.load(lane.job(k), typ=INTEGER), integer(0))
                ended = b.fcmp_ordered("<=", lane.get(attempt.left, k), zero)
                with b.if_then(b.and_(there, ended)):
                    goes_on = proceed(k)
                    stops = b.zext(b.not_(goes_on), INTEGER)
                    b.store(b.sub(b.load(active, typ=INTEGER), stops), active)
                    own = lane.job(k)
                    b.store(b.select(goes_on, b.load(own, typ=INTEGER), integer(-1)), own)
    return attempts


@dataclass(frozen=True)
class System:
    """A model's equations with the arithmetic of one step.

    Attributes:
        equations: the equations.
        attempt: one attempt at a step.
        layout: what a lane works on.
    """

    equations: Equations
    attempt: StepAttempt
    layout: Layout


def step_start_values(eq: Equations) -> dict[int, Value]:
    """Values of the paths and their direction at the start of a step, by id."""
    here = {memory.after.id: memory.value for memory in eq.rate_independent_states}
    if eq.travelled is not None and eq.rate_independent_states:
        here[eq["origin"].id] = eq.travelled[0]
    return here


def rates(eq: Equations) -> list[Value]:
    """Rates of states, then of memories of the way: their slope along it, times the speed."""
    from pma_gym.codegen.derivative import derivative
    from pma_gym.integrator.step_attempt import step_start

    frozen, here = step_start(eq)
    own = [state.rate for state in eq.states if state.name not in COMMANDS]
    rates_there = substitute(own, {**frozen, **here})
    for memory in eq.rate_independent_states:
        assert eq.travelled is not None
        (slope,) = derivative(memory.after, [eq.travelled[0]])
        assert slope is not None
        rates_there.append(substitute([slope], frozen)[0] * eq.travelled[1])
    return rates_there
