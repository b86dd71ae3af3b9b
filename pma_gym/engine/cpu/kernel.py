"""The complete compiled control step of one or many environments."""

import ctypes

from pma_gym.codegen.machine.native import Library, compiled, pairs, simd_lanes
from pma_gym.engine.cpu.step_writer import Writer
from pma_gym.engine.observation import ObservationTable
from pma_gym.engine.state_layout import StateLayout
from pma_gym.plant.equilibrium.solver import hangs_by_itself
from pma_gym.plant.program import Program, structure


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
        task, undisturbed = (
            state_layout.task,
            state_layout.options.randomisation == "none" and not state_layout.events,
        )
        pulls_none = task.actuator == "motor" and task.exercise is None
        self.draws = undisturbed and pulls_none and hangs_by_itself(program.model)
        self.library: Library = compiled(self._key(), lambda: Writer(self).module, "environment")
        get = self.library.function
        self.check = get("check", [ctypes.c_void_p], ctypes.c_int64)
        self.begin = get("begin", [ctypes.c_void_p, ctypes.c_void_p], ctypes.c_int64)
        self.table = get("table", [ctypes.c_void_p, ctypes.c_void_p])
        self.table_size = int(get("table_size", [], ctypes.c_int64)())

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
