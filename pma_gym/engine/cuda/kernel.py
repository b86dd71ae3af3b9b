"""The control step as one GPU kernel, one thread an environment, and its stand-in for tests.

Two functions take the same arguments: `step` (command, integration, sensors, reward, end) and
`begin` (new episodes where one has ended). The stand-in is the very same code for the processor,
with the number of the thread counted by a loop.
"""

import ctypes
from typing import Literal

import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

from pma_gym.codegen.cache import compile_cache
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
from pma_gym.codegen.machine.native import Library, compiled
from pma_gym.codegen.machine.ptx import (
    WARP,
    Turns,
    bounded,
    kernel,
    ptx,
    thread_count,
    thread_index,
    warp_any,
    warp_meet,
)
from pma_gym.engine.cuda.thread_writer import ThreadWriter
from pma_gym.engine.observation import ObservationTable
from pma_gym.engine.state_layout import StateLayout
from pma_gym.plant.program import Program, structure

Name = Literal["step", "begin"]

ARGUMENTS = (
    *("count", "choices", "records", "tables", "references", "actions", "observations"),
    *("rewards", "terminated", "truncated", "faults", "attempts", "finals", "scores", "pressures"),
    *("ideals", "horizon"),
)
"""Arguments of `step` and `begin`: numbers of environments and of pressures to draw from, then
addresses, and the control steps of an episode; behind them the table's numbers, where all
environments share one."""

NUMBERS = ("count", "choices", "horizon")

THREADS = 128
"""Threads of a block."""


class CudaKernel:
    """The functions of environments of one structure and one set of options.

    Args:
        program: the compiled plant.
        state_layout: what an environment's numbers are.
        table: the observation's entries.
        single: compute and keep in single precision.
        own_tables: whether every environment has a table of its own (a drawn station).
        draws: whether `begin` is wanted: threads draw pressures and settle by themselves.
        ranged: whether pressures are drawn from a range, else from several.

    Attributes:
        offsets: offset of every number that is kept, by name; they lie as [place, environment].
        element: NumPy's type of a number.
        whole: NumPy's type of an integer, of the same size.
        table_size: how many numbers a table has.
    """

    def __init__(
        self,
        program: Program,
        state_layout: StateLayout,
        table: ObservationTable,
        single: bool,
        own_tables: bool = False,
        draws: bool = True,
        ranged: bool = True,
    ) -> None:
        self.program, self.state_layout, self.observed = program, state_layout, table
        self.width, self.abreast, self.single = 1, 1, single
        self.own_tables, self.draws, self.ranged = own_tables, draws, ranged
        self.element: type[np.floating] = np.float32 if single else np.float64
        self.whole: type[np.signedinteger] = np.int32 if single else np.int64
        self._writer = ThreadWriter(self, own_tables, ranged)
        self.offsets = self._writer.offsets
        library = compiled(
            ["table", *self._key()], lambda: self._writer.table, "tables of environments"
        )
        self._table = library.function("table", [ctypes.c_void_p, ctypes.c_void_p])
        self.table_size = len(self._writer.fixed)

    @property
    def names(self) -> list[Name]:
        """Names of the functions."""
        return ["step", "begin"] if self.draws else ["step"]

    def table(self, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        """Everything that is fixed for a model, from its vector, shape (table_size,)."""
        out = np.empty(self.table_size)
        self._table(vector.ctypes.data, out.ctypes.data)
        return out

    def _key(self) -> list[str]:
        options, state_layout = self.state_layout.options, self.state_layout
        said = (
            *(options.control_rate_hz, options.preview, options.noise, options.action_delay),
            *(options.observation_delay, options.history, options.reward_name),
            options.reward_scale,
            *(options.regulator_action, options.safety, self.single),
            *(state_layout.task.structure, state_layout.events),
            *(self.own_tables, self.draws, self.ranged),
        )
        return ["threads", *structure(self.program.model), *map(str, said)]

    def table_type(self, name: Name) -> type[np.floating]:
        """NumPy's type of the table's numbers among a function's arguments."""
        return np.float64 if name == "begin" else self.element

    def shared_table(self, name: Name, table: NDArray[np.float64]) -> NDArray[np.floating]:
        """The table's numbers as a function takes them: none where each has its own."""
        return table[: 0 if self.own_tables else None].astype(self.table_type(name))

    # -- for a GPU ---------------------------------------------------------------------------------

    def ptx(self, arch: str = "sm_90") -> str:
        """PTX text of the functions, for an architecture and all that came after it."""
        key = compile_cache.digest((compile_cache.source_digest(), arch, *self._key()))
        kept = compile_cache.load(key)
        if kept is not None:
            return kept.decode()
        text = ptx(self._threads(), arch)
        compile_cache.keep(key, text.encode())
        return text

    def _threads(self) -> ir.Module:
        module = ir.Module()
        for name in self.names:
            arguments = [(n, INTEGER if n in NUMBERS else POINTER) for n in ARGUMENTS]
            element = self._table_element(name)
            fixed = [] if self.own_tables else range(self.table_size)
            arguments += [(f"fixed_{i}", element) for i in fixed]
            b, made = kernel(module, name, arguments)
            bounded(b, THREADS)
            given = {own: value for (own, _), value in zip(arguments, made, strict=True)}
            # What one thread of a warp writes there another reads.
            given["records"].attributes.discard("noalias")
            thread, threads = thread_index(b), thread_count(b)
            if name == "step":
                self._writer.step(b, given, thread, threads, _Shared(b, thread, threads))
            else:
                self._writer.begin(b, given, thread, threads)
            b.ret_void()
        return module

    def _table_element(self, name: Name) -> ir.Type:
        return DOUBLE if name == "begin" else self._writer.element

    # -- without one -------------------------------------------------------------------------------

    def cpu_library(self) -> Library:
        """The functions for the processor: (arguments, table, threads), one thread after another.

        `arguments` leads to 64-bit integers in the order of `ARGUMENTS`, `table` to the numbers
        that all environments share.
        """
        return compiled(["stand-in", *self._key()], self._loops, "threads of environments")

    def _loops(self) -> ir.Module:
        module = ir.Module()
        for name in self.names:
            b, (arguments, table, threads) = function(
                module, name, [("arguments", POINTER), ("table", POINTER), ("threads", INTEGER)]
            )
            given = {}
            for i, own in enumerate(ARGUMENTS):
                value = b.load(offset(b, arguments, i, INTEGER), typ=INTEGER)
                given[own] = value if own in NUMBERS else b.inttoptr(value, POINTER)
            element = self._table_element(name)
            for i in [] if self.own_tables else range(self.table_size):
                given[f"fixed_{i}"] = b.load(offset(b, table, i, element), typ=element)
            with loop(b, threads) as thread:
                if name == "step":
                    self._writer.step(b, given, thread, threads, _Alone(b, threads))
                else:
                    self._writer.begin(b, given, thread, threads)
            b.ret_void()
        return module


class _Shared:
    """The threads of a warp share the integrations of their environments.

    They are those that these threads command and sense: of numbers 0-31 the first of each thread,
    of 32-63 the second, and so on.
    """

    def __init__(self, builder: Builder, thread: Operand, threads: Operand) -> None:
        self._builder, self._threads = builder, threads
        self._first = builder.and_(thread, integer(-WARP))
        self._turns = Turns(builder, THREADS, WARP)

    def following(self, job: Operand) -> Operand:
        return shared_job(self._builder, self._turns.take(), self._first, self._threads)

    def any(self, truth: Operand) -> Operand:
        return warp_any(self._builder, truth)

    def meet(self) -> None:
        warp_meet(self._builder)


def shared_job(b: Builder, turn: Operand, first: Operand, threads: Operand) -> Operand:
    """Write the number of the environment that a warp integrates as its n-th.

    Args:
        b: where to write.
        turn: n.
        first: number of the warp's first thread.
        threads: number of all threads.
    """
    row = b.mul(b.udiv(turn, integer(WARP)), threads)
    return b.add(b.add(row, first), b.urem(turn, integer(WARP)))


class _Alone:
    """A thread integrates its own environments."""

    def __init__(self, builder: Builder, threads: Operand) -> None:
        self._builder, self._threads = builder, threads

    def following(self, job: Operand) -> Operand:
        return self._builder.add(job, self._threads)

    def any(self, truth: Operand) -> Operand:
        return truth

    def meet(self) -> None:
        pass
