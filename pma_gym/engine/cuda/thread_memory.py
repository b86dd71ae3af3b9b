"""Where the numbers of environments lie for threads: [place, environment].

A number of all environments lies side by side, so that threads beside each other read beside each
other.
"""

from pma_gym.codegen.graph import Kind, Value
from pma_gym.codegen.machine.control import (
    DOUBLE,
    FLOAT,
    INDEX,
    INTEGER,
    Builder,
    Operand,
    integer,
    offset,
)
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.trace import live_inputs
from pma_gym.engine.cpu.block_memory import KernelSpec, narrowed
from pma_gym.engine.cpu.step_writer import Writer
from pma_gym.integrator.integration import FUSED


class ThreadMemory(Writer):
    """A writer whose environments each have a thread, with numbers as [place, environment].

    Args:
        kernel: the record, the observation, whether in single precision.
        own_tables: whether every environment has a table of its own.
        ranged: whether they draw from a range of pressures, else from several.

    Attributes:
        table: module of the functions that make a table, for the processor.
        offsets: offset of every number that is kept; fewer than the processor keeps.
    """

    def __init__(self, kernel: KernelSpec, own_tables: bool, ranged: bool) -> None:
        self.own_tables, self.ranged = own_tables, ranged
        super().__init__(kernel)

    def _prepare(self) -> None:
        self.traces = False
        self.element = FLOAT if self.kernel.single else DOUBLE
        self.real = "float" if self.kernel.single else "double"
        self._find_offsets()

    def _find_offsets(self) -> None:
        """Keep what some part reads, and the score."""
        step_graph, state_layout = self.step_graph, self.state_layout
        info_only = {
            *state_layout.info,
            *(f"true_{part}" for part in ("rotation", "load", "pressure")),
        }
        sensed = [value for name, value in self.sensed.items() if name not in info_only]
        entries = step_graph.observation(self.kernel.observed, self.sensed)
        made = [*self.layout_values, *sensed, *entries, *self.tare, *self.commanded.values()]
        read = {value.id for value in live_inputs(made)}
        always = {"sample", "ended", *self.sums, "count", "key_0", "key_1", "episode"}
        # What only an info tells is computed with the rest.
        always |= {"operator_moment"} & set(state_layout.offsets)
        names = [n for n in state_layout.offsets if step_graph.slot(n).id in read or n in always]
        self.offsets = {name: i for i, name in enumerate(names)}

    @property
    def layout_values(self) -> list[Value]:
        """What the integration computes."""
        return [*self.attempt.states, self.attempt.next_size, *self.extra]

    @property
    def sums(self) -> list[str]:
        """Places of the sums of squared errors, one a phase."""
        return [f"sum_{phase.name}" for phase in self.state_layout.task.schedule.phases]

    def _write(self) -> None:
        self._table()
        self.table = self.module

    # -- memory ------------------------------------------------------------------------------------

    def _block(self, b: Builder, given: dict[str, Operand], block: Operand) -> tuple[Operand, ...]:
        self._spacing, self._given = given["count"], given
        return (
            offset(b, given["records"], block, self.element),
            offset(b, given["tables"], block, self.element),
        )

    def _row(self, b: Builder, name: str, lane: int = 0) -> Operand:
        return b.mul(self._spacing, integer(self.offsets[name]))

    def _lanes(self, width: int) -> SimdEmitter:
        return SimdEmitter(width, self.real, FUSED)

    def _load(self, b: Builder, simd: SimdEmitter, where: Operand, kind: Kind) -> Operand:
        return self._count(b, where) if kind == "integer" else super()._load(b, simd, where, kind)

    def _keep(
        self, b: Builder, simd: SimdEmitter, number: Operand, where: Operand, kind: Kind
    ) -> None:
        if kind != "integer":
            super()._keep(b, simd, number, where, kind)
        else:
            b.store(b.trunc(number, INDEX) if self.kernel.single else number, where)

    def _count(self, b: Builder, where: Operand) -> Operand:
        # As wide as a real: counts and words of random numbers have 32 bits.
        if self.kernel.single:
            return b.zext(b.load(where, typ=INDEX), INTEGER)
        return b.load(where, typ=INTEGER)

    def _fixed(
        self, b: Builder, simd: SimdEmitter, tables: Operand, lane: Operand | int
    ) -> dict[int, Operand]:
        known = {}
        for i, value in enumerate(self.fixed):
            if self.own_tables:
                where = offset(b, tables, b.mul(self._spacing, integer(i)), self.element)
                known[value.id] = b.load(where, typ=self.element)
            else:
                known[value.id] = narrowed(b, self._given[f"fixed_{i}"], simd.element)
        return known

    def _number(self, b: Builder, records: Operand, name: str) -> Operand:
        return b.load(self._cell(b, records, name, 0), typ=self.element)
