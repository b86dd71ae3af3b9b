"""Memory layout of environments for the processor: [block, offset, lane].

The lanes of a block are environments side by side, so that a vector holds one number of each.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from llvmlite import ir

from pma_gym.codegen.graph import Kind, Value
from pma_gym.codegen.machine.control import (
    DOUBLE,
    FLOAT,
    INTEGER,
    POINTER,
    Builder,
    Operand,
    integer,
    offset,
)
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.trace import live_inputs
from pma_gym.engine.graph.control_step_graph import ControlStepGraph
from pma_gym.engine.graph.scoring import Sampling
from pma_gym.engine.observation import ObservationTable
from pma_gym.engine.state_layout import StateLayout
from pma_gym.integrator.integration import FUSED
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.model import Model
from pma_gym.plant.program import Program

ARGUMENTS = (
    *("first", "last", "count", "records", "tables", "table_stride", "references"),
    *("actions", "observations", "rewards", "terminated", "truncated", "trace", "indices"),
    *("attempts", "voltages", "ideals", "settles", "pressures", "horizon", "reference_stride"),
)
"""Entries of a call's arguments: numbers of blocks and environments, then addresses.

With settles other than 0 a beginning draws pressures, from two numbers each, and settles there.
The horizon is the number of control steps after which episodes are truncated. References and ideal
positions of an environment lie the stride behind those of the one before; 0 if all share them."""

BEFORE = len(ARGUMENTS)
"""Place, behind them, of the address of those of another part that the same thread took before."""


class KernelSpec(Protocol):
    """What a writer needs to know: a `Kernel`, or a kernel for other machines.

    Attributes:
        abreast: how many of the readings that zero the sensors are computed at once.
        graph_type: the parts of a control step.
    """

    program: Program

    @property
    def state_layout(self) -> StateLayout:
        """Places of an environment's numbers."""
        ...

    observed: ObservationTable
    width: int
    abreast: int
    single: bool
    draws: bool
    graph_type: type[ControlStepGraph]

    @property
    def equations_type(self) -> Callable[..., PlantEquations]:
        """What makes the plant's equations."""
        ...


class BlockMemory:
    """Reads and writes the numbers of environments.

    Args:
        kernel: what is written, and for how many lanes.

    Attributes:
        element: type of a number in the records.
        offsets: offset of every number that is kept, by name.
        fixed: what is computed once for a model, in the order of its table.
    """

    def __init__(self, kernel: KernelSpec) -> None:
        model: Model = kernel.program.model
        self.kernel, self.state_layout, self.width = kernel, kernel.state_layout, kernel.width
        self.element: ir.Type = DOUBLE
        self.offsets = kernel.state_layout.offsets
        self.eq = kernel.equations_type(model.effects, model.parameters)
        model.rig.write_equations(self.eq)
        self.step_graph = kernel.graph_type(kernel.state_layout, self.eq)
        self.fixed: list[Value] = []

    def _arguments(self, b: Builder, arguments: Operand) -> dict[str, Operand]:
        by_name = {}
        numbers = (
            *("first", "last", "count", "table_stride", "settles", "horizon", "reference_stride"),
        )
        for i, name in enumerate(ARGUMENTS):
            value = b.load(offset(b, arguments, i, INTEGER), typ=INTEGER)
            by_name[name] = value if name in numbers else b.inttoptr(value, POINTER)
        return by_name

    def _place(
        self, b: Builder, records: Operand, block: Operand, name: str, lane: Operand | int
    ) -> Operand:
        """Address of one environment's number."""
        row = b.mul(block, integer(self.state_layout.size * self.width))
        at = b.add(row, integer(self.state_layout.offsets[name] * self.width))
        return offset(b, records, b.add(at, integer(lane)))

    def _row(self, b: Builder, name: str, lane: int = 0) -> Operand:
        """How many numbers of a block lie before those of a place, or before one lane's."""
        return integer(self.offsets[name] * self.width + lane)

    def _cell(self, b: Builder, records: Operand, name: str, lane: Operand | int) -> Operand:
        """Address of a number of one lane of a block."""
        at = b.add(self._row(b, name), integer(lane))
        return offset(b, records, at, self.element)

    def _lanes(self, width: int) -> SimdEmitter:
        """The emitter for what is not the integration."""
        return SimdEmitter(width, fused=FUSED)

    def _load(self, b: Builder, simd: SimdEmitter, where: Operand, kind: Kind) -> Operand:
        return simd.load(b, where, 0, kind)

    def _keep(
        self, b: Builder, simd: SimdEmitter, number: Operand, where: Operand, kind: Kind
    ) -> None:
        simd.store(b, number, where, 0, kind)

    def _count(self, b: Builder, where: Operand) -> Operand:
        """An integer of one environment."""
        return b.load(where, typ=INTEGER)

    def _exact_times(
        self, b: Builder, one: Sampling, known: dict[int, Operand]
    ) -> dict[int, Operand]:
        """Times of a sample that are not left to the integration's precision."""
        return {}

    def _fixed(
        self, b: Builder, simd: SimdEmitter, tables: Operand, lane: Operand | int
    ) -> dict[int, Operand]:
        """The table of a block, or of one lane of it."""
        known = {}
        scalar = simd.width == 1
        for i, value in enumerate(self.fixed):
            at = integer(i * self.width)
            where = offset(b, tables, b.add(at, integer(lane)) if scalar else at)
            known[value.id] = simd.load(b, where)
        return known

    def _known(
        self,
        b: Builder,
        simd: SimdEmitter,
        values: Sequence[Value],
        records: Operand,
        tables: Operand,
        lane: Operand | int,
    ) -> dict[int, Operand]:
        """Inputs and table of a block (or, in scalar code, of one lane of it), as far as used."""
        known: dict[int, Operand] = {}
        names = {self.step_graph.slot(name).id: name for name in self.offsets}
        scalar = simd.width == 1
        for value in live_inputs(values):
            if value.id in names:
                at = self._row(b, names[value.id])
                index = b.add(at, integer(lane)) if scalar else at
                where = offset(b, records, index, self.element)
                known[value.id] = self._load(b, simd, where, value.kind)
        return known | self._fixed(b, simd, tables, lane)

    def _store(
        self,
        b: Builder,
        simd: SimdEmitter,
        emitted: dict[int, Operand],
        values: dict[str, Value],
        records: Operand,
        lane: Operand | int,
    ) -> None:
        scalar = simd.width == 1
        for name, value in values.items():
            if name not in self.offsets:
                continue
            at = self._row(b, name)
            index = b.add(at, integer(lane)) if scalar else at
            where = offset(b, records, index, self.element)
            self._keep(b, simd, emitted[value.id], where, self.state_layout.kind(name))

    def _block(self, b: Builder, given: dict[str, Operand], block: Operand) -> tuple[Operand, ...]:
        """Addresses of a block's records and tables."""
        records = offset(
            b, given["records"], b.mul(block, integer(self.state_layout.size * self.width))
        )
        return records, offset(b, given["tables"], b.mul(block, given["table_stride"]))

    def _gathered(self, b: Builder, simd: SimdEmitter, numbers: Sequence[Operand]) -> Operand:
        if simd.width == 1:
            return simd.spread(b, numbers[0])
        vector = ir.Constant(simd.real, ir.Undefined)
        for k, number in enumerate(numbers):
            vector = simd.insert(b, vector, number, k)
        return vector

    def _references(
        self,
        b: Builder,
        simd: SimdEmitter,
        given: dict[str, Operand],
        records: Operand,
        lane: Operand | int,
        first: Operand,
        steps_ahead: int,
        later: int,
    ) -> Operand:
        """References so many steps ahead, for a block or one lane, by its first environment."""
        references = []
        for k in range(simd.width):
            index = self._row(b, "count", k)
            if simd.width == 1:
                index = b.add(index, integer(lane))
            steps = self._count(b, offset(b, records, index, self.element))
            row = b.mul(b.add(first, integer(k)), given["reference_stride"])
            row = b.add(row, b.add(steps, integer(steps_ahead + later)))
            where = offset(b, given["references"], row, self.element)
            references.append(b.load(where, typ=self.element))
        return self._gathered(b, simd, references)

    def _put_observation(
        self,
        b: Builder,
        simd: SimdEmitter,
        given: dict[str, Operand],
        emitted: dict[int, Operand],
        entries: Sequence[Value],
        first: Operand,
    ) -> None:
        for i, entry in enumerate(entries):
            for k in range(simd.width):
                number = simd.extract(b, emitted[entry.id], k)
                row = b.mul(b.add(first, integer(k)), integer(len(entries)))
                where = offset(b, given["observations"], b.add(row, integer(i)), FLOAT)
                b.store(narrowed(b, number, FLOAT), where)


def narrowed(b: Builder, number: Operand, element: ir.Type) -> Operand:
    """A number as one of a type that holds no more."""
    return number if number.type == element else b.fptrunc(number, element)


def widened(b: Builder, number: Operand) -> Operand:
    """A number in double precision."""
    return number if number.type == DOUBLE else b.fpext(number, DOUBLE)
