"""Memory of environments: numbers in blocks of lanes, and the kernel that steps them.

The complete compiled control step of one or many environments.
"""

import ctypes
from collections.abc import Callable

import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

from pma_gym.codegen.machine.native import Library, compiled, pairs, simd_lanes
from pma_gym.engine.cpu.block_memory import ARGUMENTS, BEFORE
from pma_gym.engine.cpu.step_writer import Writer
from pma_gym.engine.graph.control_step_graph import ControlStepGraph
from pma_gym.engine.observation import ObservationTable, step_references
from pma_gym.engine.options import Options, draw_task
from pma_gym.engine.state_layout import StateLayout
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.solver import hangs_by_itself
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import Program, structure
from pma_gym.tasks import Task, limit_in_words


class Kernel:
    """The compiled functions of environments of one structure and one set of options.

    Args:
        program: the compiled plant.
        state_layout: places of an environment's numbers.
        table: the observation's entries.
        width: lanes of a block; records lie as [block, place, lane].
        single: whether the integration runs in single precision.

    Attributes:
        draws: whether `begin` can draw pressures and settle by itself: one station, undisturbed,
            that pulls on no load.
    """

    equations_type: Callable[..., PlantEquations] = PlantEquations
    graph_type: type[ControlStepGraph] = ControlStepGraph

    def __init__(
        self,
        program: Program,
        state_layout: StateLayout,
        table: ObservationTable,
        width: int,
        single: bool = False,
    ) -> None:
        self.program, self.state_layout, self.observed = program, state_layout, table
        self.width, self.abreast, self.single = width, simd_lanes(), single
        self.draws = self._draws()
        self.library: Library = compiled(self._key(), self._module, "environment")
        get = self.library.function
        self.check = get("check", [ctypes.c_void_p], ctypes.c_int64)
        self.begin = get("begin", [ctypes.c_void_p, ctypes.c_void_p], ctypes.c_int64)
        self.table = get("table", [ctypes.c_void_p, ctypes.c_void_p])
        self.table_size = int(get("table_size", [], ctypes.c_int64)())

    def _draws(self) -> bool:
        task, options = self.state_layout.task, self.state_layout.options
        undisturbed = options.randomisation == "none" and not self.state_layout.events
        pulls_none = task.actuator == "motor" and task.exercise is None
        return undisturbed and pulls_none and hangs_by_itself(self.program.model)

    def _module(self) -> ir.Module:
        return Writer(self).module

    def _key(self) -> list[str]:
        options, state_layout = self.state_layout.options, self.state_layout
        said = (
            *(options.control_rate_hz, options.preview, options.noise, options.action_delay),
            *(options.observation_delay, options.history, options.reward_name),
            options.reward_scale,
            *(options.regulator_action, options.safety, self.draws),
            *(self.width, self.abreast, self.single, pairs(self.width)),
            *(state_layout.task.structure, state_layout.events),
        )
        return ["environment", *structure(self.program.model), *map(str, said)]


class EngineMemory:
    """Memory of n environments; see `Engine` for arguments and attributes.

    Args:
        nominal_model: the nominal model that controllers receive.
        nominal: the Plant of the nominal model.
    """

    layout_type, table_type, kernel_type = StateLayout, ObservationTable, Kernel

    def __init__(
        self,
        task: Task,
        options: Options,
        nominal_model: Model,
        nominal: Plant,
        count: int,
        single: bool,
    ) -> None:
        """Compile, and allocate arrays."""
        self.task, self.options, self.count = task, options, count
        self.nominal_model, self.nominal = nominal_model, nominal
        self.state_layout = self.layout_type(tuple(self.nominal.states), task, options)
        self.table = self.table_type(task, options)
        self.width = 1 if count == 1 else simd_lanes(single)
        program = self.nominal.program
        self.kernel = self.kernel_type(program, self.state_layout, self.table, self.width, single)
        self.models = [self.nominal.model] * count
        self.tasks, self._drawn_by = [task] * count, [(0, 0, -1)] * count
        self.pressures = np.zeros(count)
        self.horizon = options.horizon(task)
        self._allocate()
        self._address = self._arguments.ctypes.data

    def _allocate(self) -> None:
        state_layout, width = self.state_layout, self.width
        self.blocks = -(-self.count // width)
        padded = self.blocks * width
        options = self.options
        self.records = np.zeros((self.blocks, state_layout.size, width))
        self.integers = self.records.view(np.int64)
        self._shares_table = options.randomisation == "none"
        rows = 1 if self._shares_table else self.blocks
        self._tables = np.zeros((rows, self.kernel.table_size, width))
        self._tables[:] = self._table_of(self.nominal.vector)[:, None]
        steps = self.task.steps(options.control_rate_hz)
        self.actions = np.zeros((padded, state_layout.actions))
        self._all_observations = np.zeros((padded, len(self.table.rows)), np.float32)
        self._all_rewards = np.zeros(padded)
        self._all_flags = np.zeros((2, padded), np.bool_)
        self.observations = self._all_observations[: self.count]
        self.rewards = self._all_rewards[: self.count]
        self.terminated, self.truncated = self._all_flags[:, : self.count]
        duration = (steps + 2) * options.period
        samples = int(duration * 384.0) + 8
        self.trace = np.zeros(samples if width == 1 else 1)
        self._samples = samples if self.task.schedule.motion is not None else 1
        rows = 1 if options.reference is None else padded
        self._followed = np.tile(self._row_of(self.task), (rows, 1))
        self._references, self._ideals = np.split(self._followed, [-self._samples], axis=1)
        self.voltages = np.zeros(steps + 2 if width == 1 else 1)
        self._indices = np.zeros(max(self.count, 1), np.int64)
        self._ranges = np.zeros((max(self.count, 1), 2))
        self._episodes = np.full(self.count, -1, np.int64)
        self._keys = np.zeros((self.count, 2), np.int64)
        self._arguments = np.zeros(BEFORE + 1, np.int64)
        stride = 0 if self._shares_table else self.kernel.table_size * width
        given = {
            "first": 0,
            "last": self.blocks,
            "count": self.count,
            "table_stride": stride,
            "records": self.records.ctypes.data,
            "tables": self._tables.ctypes.data,
            "references": self._references.ctypes.data,
            "actions": self.actions.ctypes.data,
            "observations": self._all_observations.ctypes.data,
            "rewards": self._all_rewards.ctypes.data,
            "terminated": self._all_flags[0].ctypes.data,
            "truncated": self._all_flags[1].ctypes.data,
            "trace": self.trace.ctypes.data,
            "indices": self._indices.ctypes.data,
            "attempts": 0,
            "voltages": self.voltages.ctypes.data,
            "ideals": self._ideals.ctypes.data,
            "settles": 0,
            "pressures": self._ranges.ctypes.data,
            "horizon": self.horizon,
            "reference_stride": 0 if options.reference is None else self._followed.shape[1],
        }
        self._arguments[:BEFORE] = [given[name] for name in ARGUMENTS]
        self._count_attempts(1)
        self._idle_lanes = self.integers[-1, state_layout.offsets["count"], self.count % width :]
        self._has_idle_lanes = self.count % width != 0

    def _count_attempts(self, parts: int) -> None:
        """Make room for the attempts of so many parts of a step, a line of the cache each."""
        self._attempts = np.zeros((parts, 8), np.int64)
        self._arguments[ARGUMENTS.index("attempts")] = self._attempts.ctypes.data

    def _table_of(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty(self.kernel.table_size)
        self.kernel.table(numbers.ctypes.data, out.ctypes.data)
        return out

    def _row_of(self, task: Task) -> NDArray[np.float64]:
        """References of a task at the control steps, then its ideal positions at the samples."""
        # What has ended may be stepped once more before it is reset.
        steps = np.pad(step_references(task, self.options), (0, 2), mode="edge")
        return np.concatenate([steps, task.ideals(self._samples)])

    def references(self, index: int) -> NDArray[np.float64]:
        """References of an environment's episode at the control steps (m or rad), and beyond."""
        return self._references[index % len(self._references)]

    def _generator(self, index: int, stream: int) -> np.random.Generator:
        """Random numbers of an environment's episode, as a function of its counters."""
        seed = int(self._keys[index, 0]) | int(self._keys[index, 1]) << 32
        counter = [0, 0, stream, int(self._episodes[index])]
        return np.random.Generator(np.random.Philox(key=seed, counter=counter))

    def _draw_tasks(self, indices: NDArray[np.int64]) -> None:
        """Draw what episodes follow, unless it is drawn already."""
        if self.options.reference is None:
            return
        for index in indices.tolist():
            drawn_by = (*self._keys[index].tolist(), int(self._episodes[index]))
            if drawn_by != self._drawn_by[index]:
                task = self.task
                if drawn_by[-1] >= 0:
                    task = self._drawn_task(self._generator(index, 1))
                self._followed[index], self.tasks[index] = self._row_of(task), task
                self._drawn_by[index] = drawn_by

    def _drawn_task(self, generator: np.random.Generator) -> Task:
        """What an episode follows, by its random numbers."""
        return draw_task(self.task, self.options.reference, generator)

    def limit_in_words(self, index: int, code: float) -> str:
        """Name of the limit that ended an environment's episode; "" for a code of 0."""
        return limit_in_words(self.models[index], code, self.task.exercise)

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Copy a number of every environment, given by name, shape (n,)."""
        return self.records[:, self.state_layout.offsets[name], :].reshape(-1)[: self.count].copy()

    def row(self, index: int) -> list[float]:
        """View of all numbers of an environment."""
        block, lane = divmod(index, self.width)
        return self.records[block, :, lane].tolist()

    def steps(self, index: int) -> int:
        """Control steps of an environment's episode so far."""
        block, lane = divmod(index, self.width)
        return int(self.integers[block, self.state_layout.offsets["count"], lane])

    def rows(self, indices: NDArray[np.int64]) -> NDArray[np.float64]:
        """Copy all numbers of some environments, shape (m, size of the record)."""
        block, lane = np.divmod(indices, self.width)
        return self.records[block, :, lane]

    def _of(self, name: str, indices: NDArray[np.int64]) -> NDArray[np.float64]:
        """A number of some environments."""
        block, lane = np.divmod(indices, self.width)
        return self.records[block, self.state_layout.offsets[name], lane]

    def counts(self) -> NDArray[np.int64]:
        """Control steps of every episode so far, shape (n,)."""
        return (
            self.integers[:, self.state_layout.offsets["count"], :].reshape(-1)[: self.count].copy()
        )
