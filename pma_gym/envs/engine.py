"""Environments as arrays: one, or many that step together."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.envs.advance import BOUND
from pma_gym.envs.beginning import (
    Settled,
    drawn_events,
    drawn_pressures,
    hangs_slack,
    holding_voltages,
    settled_at_no_load,
    settled_under_load,
)
from pma_gym.envs.block_memory import ARGUMENTS
from pma_gym.envs.kernel import Kernel
from pma_gym.envs.kernel_writer import BAD_ACTION
from pma_gym.envs.observation import ObservationTable
from pma_gym.envs.operators import check_prescription, operators, wound_back
from pma_gym.envs.options import Options, Pressure, motor_at_rest, rig_model, told_model
from pma_gym.envs.record import START, Record
from pma_gym.kernels import arrays
from pma_gym.kernels.builtin import builtin
from pma_gym.kernels.crew import Crew
from pma_gym.kernels.native import simd_lanes
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant, regulator_voltage
from pma_gym.plant.program import FIRST_S, vector
from pma_gym.plant.settle import NoLoad
from pma_gym.tasks import Events, Task

_FIRST, _LAST, _SETTLES = (ARGUMENTS.index(name) for name in ("first", "last", "settles"))

_DRAWN_BY = "key_0", "key_1", "episode"


class Engine:
    """State of n environments, and what moves it.

    What becomes of an environment depends on its seed, its episode and its actions alone, not on
    the others, on how many there are, nor on the number of threads.

    Args:
        task: the task.
        options: the options, the same for all.
        count: how many environments.
        threads: how many threads step them.
        single: march in single precision: faster, see `PMAVectorEnv`.
        pressures: pressure of each, if they differ: as the option `pressure_kpa`, one each.

    Attributes:
        count: how many environments.
        record: places of an environment's numbers.
        table: the observation's entries.
        width: environments that share a block, one lane each.
        told: the nominal model that controllers are told.
        nominal: the Plant of the nominal model, with what `disturbances` need.
        models: the Model of every environment's episode.
        pressures: gauge pressure that every episode began at (Pa), shape (n,).
        observations: of the last step or reset, float32, shape (n, entries).
        rewards: of the last step, shape (n,).
        terminated: of the last step, bool, shape (n,).
        truncated: of the last step, bool, shape (n,).
        trace: true position at k / 384 s of a single environment (m or rad).
        voltages: voltage of the task's actuator that a single environment's station heard in every
            step (V).
        rest_motor: motor voltage that episodes begin at (V): it holds the load of a regulator's
            task, by the nominal drive.
    """

    def __init__(
        self,
        task: Task,
        options: Options,
        count: int = 1,
        threads: int = 1,
        single: bool = False,
        pressures: Sequence[Pressure] | None = None,
    ) -> None:
        """Compile, and make room."""
        self.task, self.options, self.count = task, options, count
        self._possible: set[str] = set()
        self.wanted = list(pressures) if pressures is not None else [options.pressure_kpa] * count
        self.told = told_model(task, load_model(options.model))
        # The very same model where nothing is added: its plant is known by that.
        self.nominal = Plant(rig_model(task, replace(options, model=self.told)))
        self.rest_motor = motor_at_rest(self.told, task)
        self._rest = NoLoad(self.nominal)
        self._check_prescription(self.wanted)
        self.record = Record(tuple(self.nominal.states), task, options)
        self.table = ObservationTable(task, options)
        self.width = 1 if count == 1 else simd_lanes(single)
        program = self.nominal.program
        self.kernel = Kernel(program, self.record, self.table, self.width, single)
        self.models = [self.nominal.model] * count
        self.pressures = np.zeros(count)
        self._allocate()
        self._settling = self._slack_range()
        self._address = self._arguments.ctypes.data
        self._beginning = self._arguments.copy()
        self._begin_address = self._beginning.ctypes.data
        self._crew = Crew(self.kernel.library.address("step"), self._parts(threads))

    def _allocate(self) -> None:
        record, width = self.record, self.width
        self.blocks = -(-self.count // width)
        padded = self.blocks * width
        options = self.options
        self.records = np.zeros((self.blocks, record.size, width))
        self.integers = self.records.view(np.int64)
        self._shares_table = options.randomisation == "none"
        rows = 1 if self._shares_table else self.blocks
        self._tables = np.zeros((rows, self.kernel.table_size, width))
        self._tables[:] = self._table_of(self.nominal.vector)[:, None]
        steps = self.task.steps(options.control_rate_hz)
        # What has ended may be stepped once more before it is reset.
        self._references = np.pad(self.table.references, (0, 2), mode="edge")
        self.actions = np.zeros((padded, record.actions))
        self._all_observations = np.zeros((padded, len(self.table.rows)), np.float32)
        self._all_rewards = np.zeros(padded)
        self._all_flags = np.zeros((2, padded), np.bool_)
        self.observations = self._all_observations[: self.count]
        self.rewards = self._all_rewards[: self.count]
        self.terminated, self.truncated = self._all_flags[:, : self.count]
        duration = (steps + 2) * options.period
        samples = int(duration * 384.0) + 8
        self.trace = np.zeros(samples if width == 1 else 1)
        moves = self.task.protocol.motion is not None
        self._ideals = self.task.ideals(samples if moves else 1)
        self.voltages = np.zeros(steps + 2 if width == 1 else 1)
        self._indices = np.zeros(max(self.count, 1), np.int64)
        self._ranges = np.zeros((max(self.count, 1), 2))
        self._attempts = np.zeros((256, 8), np.int64)
        self._episodes = np.full(self.count, -1, np.int64)
        self._keys = np.zeros((self.count, 2), np.int64)
        self._arguments = np.zeros(len(ARGUMENTS), np.int64)
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
            "attempts": self._attempts.ctypes.data,
            "voltages": self.voltages.ctypes.data,
            "ideals": self._ideals.ctypes.data,
            "settles": 0,
            "pressures": self._ranges.ctypes.data,
        }
        self._arguments[:] = [given[name] for name in ARGUMENTS]
        self._idle_lanes = self.integers[-1, record.places["count"], self.count % width :]
        self._has_idle_lanes = self.count % width != 0

    def _table_of(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty(self.kernel.table_size)
        self.kernel.table(numbers.ctypes.data, out.ctypes.data)
        return out

    def _parts(self, threads: int) -> list[NDArray[np.int64]]:
        """The arguments of a step, a share of the blocks for each thread."""
        threads = max(1, min(threads, self.blocks))
        edges = np.linspace(0, self.blocks, threads + 1).round().astype(int)
        parts = [self._arguments.copy() for _ in range(threads)]
        for k, part in enumerate(parts):
            part[_FIRST], part[_LAST] = edges[k : k + 2]
            part[ARGUMENTS.index("attempts")] += 64 * k
        return parts

    # -- places ------------------------------------------------------------------------------------

    def numbers(self, name: str) -> NDArray[np.float64]:
        """A number of every environment by its place's name, shape (n,); a copy."""
        return self.records[:, self.record.places[name], :].reshape(-1)[: self.count].copy()

    def row(self, index: int) -> list[float]:
        """All numbers of an environment, by place."""
        block, lane = divmod(index, self.width)
        return self.records[block, :, lane].tolist()

    def rows(self, indices: NDArray[np.int64]) -> NDArray[np.float64]:
        """All numbers of some environments, shape (m, size of the record); a copy."""
        block, lane = np.divmod(indices, self.width)
        return self.records[block, :, lane]

    def _of(self, name: str, indices: NDArray[np.int64]) -> NDArray[np.float64]:
        """A number of some environments."""
        block, lane = np.divmod(indices, self.width)
        return self.records[block, self.record.places[name], lane]

    def counts(self) -> NDArray[np.int64]:
        """Control steps of every episode so far, shape (n,)."""
        return self.integers[:, self.record.places["count"], :].reshape(-1)[: self.count].copy()

    # -- episodes ----------------------------------------------------------------------------------

    def seed(self, indices: NDArray[np.int64], seeds: Sequence[int | None]) -> None:
        """Begin the random numbers of environments anew; None keeps an environment's own."""
        for index, seed in zip(indices.tolist(), seeds, strict=True):
            if seed is not None or self._episodes[index] < 0 and not self._keys[index].any():
                self._keys[index] = np.random.SeedSequence(seed).generate_state(2)
                self._episodes[index] = -1
                block, lane = divmod(index, self.width)
                for name, number in zip(_DRAWN_BY, (*self._keys[index], -1), strict=True):
                    self.integers[block, self.record.places[name], lane] = number

    def reset(self, indices: NDArray[np.int64], wanted: Sequence[Pressure] | None = None) -> None:
        """Begin an episode: draw pressure and station, settle, zero the sensors.

        Args:
            indices: which environments, shape (m,).
            wanted: pressure of each for this episode; the option's if not given.
        Raises:
            ValueError: a pressure that the regulator does not reach, or at which nothing balances
                the task's load.
        """
        if wanted is not None:
            self._check_prescription(wanted)
        count = len(indices)
        self._episodes[indices] += 1
        asked = [self.wanted[i] for i in indices.tolist()] if wanted is None else list(wanted)
        settles = self._settles(asked)
        if not settles:
            self._begin_drawn(indices, asked)
        self._indices[:count] = indices
        self._beginning[_LAST], self._beginning[_SETTLES] = count, settles
        self.kernel.begin(self._begin_address)
        if settles:
            self.pressures[indices] = self._of("pressure", indices)

    def _settles(self, asked: Sequence[Pressure]) -> bool:
        """Write ranges of pressures for compiled beginnings; whether they find a rest in all."""
        lowest, highest = self._settling
        for row, one in zip(self._ranges, asked, strict=False):
            if isinstance(one, str):
                low, high = self.task.starts
            elif isinstance(one, Sequence):
                return False
            else:
                low = high = 1e3 * float(one)
            if not (lowest <= low and high <= highest):
                return False
            row[0], row[1] = low, high
        return True

    def _slack_range(self) -> tuple[float, float]:
        """Pressures at which compiled beginnings find a rest (Pa), none if the first is larger."""
        low, high = self.task.starts
        if not self.kernel.draws:
            return np.inf, -np.inf
        try:
            for pressure in (low, high):
                regulator_voltage(self.nominal.model, pressure)
        except ValueError:
            return np.inf, -np.inf
        return (low, high) if hangs_slack(self._rest, low, high) else (np.inf, -np.inf)

    def _begin_drawn(self, indices: NDArray[np.int64], asked: Sequence[Pressure]) -> None:
        """Write down where stations rest that are drawn, disturbed or under load."""
        pressures = drawn_pressures(self.task, self._keys[indices], self._episodes[indices], asked)
        vectors = self._drawn_models(indices)
        regulator = holding_voltages([self.models[i] for i in indices.tolist()], pressures)
        states, zero = self._settled(indices, pressures, regulator, vectors)
        self.pressures[indices] = pressures
        self._fill(indices, states, zero, regulator)

    def _check_prescription(self, wanted: Sequence[Pressure]) -> None:
        """Refuse pressures at which an exercise's device cannot give what is prescribed."""
        if self.task.exercise is None:
            return
        new = {repr(one): one for one in wanted if repr(one) not in self._possible}
        check_prescription(self.task, self.told, new.values())
        self._possible |= set(new)

    def _drawn_models(self, indices: NDArray[np.int64]) -> NDArray[np.float64] | None:
        """Draw the stations of episodes; their vectors, or None if all are nominal."""
        if self._shares_table:
            return None
        draw = self.options.draw
        rows = []
        for index in indices.tolist():
            key = self._keys[index].astype(np.uint64)
            seed = int(key[0]) | int(key[1]) << 32
            bits = np.random.Philox(key=seed, counter=[0, 0, 0, int(self._episodes[index])])
            self.models[index] = self._checked(draw(self.nominal.model, np.random.Generator(bits)))
            rows.append(vector(self.models[index], self.nominal.tolerance))
            block, lane = divmod(index, self.width)
            self._tables[block, :, lane] = self._table_of(rows[-1])
        return np.array(rows)

    def _checked(self, drawn: Model) -> Model:
        """A drawn station, if the compiled one can be it."""
        if not isinstance(drawn, Model):
            raise ValueError(
                "a randomisation must give a Model, got "
                f"{drawn!r}; return the one that it is given, or what its replace() gives"
            )
        if list(drawn.effects) != list(self.nominal.model.effects):
            odd = sorted(set(drawn.effects) ^ set(self.nominal.model.effects))
            raise ValueError(
                "a randomisation must give a model with the effects of the one that it is given, "
                f"in their order; these differ: {', '.join(odd) or 'their order'}; give both all "
                "of them, neutral where a station has them not"
            )
        return drawn

    def _settled(
        self,
        indices: NDArray[np.int64],
        pressures: NDArray[np.float64],
        regulator: NDArray[np.float64],
        vectors: NDArray[np.float64] | None,
    ) -> Settled:
        models = [self.models[i] for i in indices.tolist()]
        if not self.rest_motor:
            return settled_at_no_load(self._rest, models, pressures, regulator, vectors)
        held = self.rest_motor, regulator, pressures, vectors
        states, zero = settled_under_load(self.nominal, *held)
        if self.task.exercise:
            radii = np.array([model.parameters["rotor"].radius for model in models])
            wound_back(self.record.states, states, zero, radii)
        return states, zero

    def _fill(
        self,
        indices: NDArray[np.int64],
        states: NDArray[np.float64],
        zero: NDArray[np.float64],
        regulator: NDArray[np.float64],
    ) -> None:
        places, size = self.record.places, self.record.size
        rows = np.zeros((len(indices), size))
        wholes = rows.view(np.int64)

        def put(name: str, values: ArrayLike) -> None:
            rows[:, places[name]] = values

        rows[:, : len(self.record.states)] = states
        put("size", FIRST_S)
        put("zero_contraction", zero)
        put("regulator_voltage", regulator)
        put("rest_regulator", regulator)
        for i in range(2):
            wholes[:, places[f"key_{i}"]] = self._keys[indices, i]
        wholes[:, places["episode"]] = self._episodes[indices]
        held = np.maximum(np.minimum(0.2 * regulator - 1.0, 1.0), -1.0)
        volts: list[ArrayLike] = [0.0, regulator]
        actions: list[ArrayLike] = [-1.0, held]
        if self.task.actuator == "regulator":
            for name in ("motor_voltage", "rest_motor"):
                put(name, self.rest_motor)
            put(START, states[:, self.record.states.index("contraction")])
            volts, actions = volts[1:], actions[1:]
        for i in range(self.record.actions):
            put(f"action_{i}", actions[i])
            for k in range(self.options.action_delay):
                put(f"wire_{k}_{i}", volts[i])
        if self.record.events:
            self._put_events(indices, put)
        if self.task.exercise:
            drawn_by = self._keys[indices], self._episodes[indices], self.pressures[indices]
            told = operators(self.task, self.options, self.told, *drawn_by, regulator)
            for name, values in told.items():
                put(name, values)
        block, lane = np.divmod(indices, self.width)
        self.records[block, :, lane] = rows

    def _put_events(
        self, indices: NDArray[np.int64], put: Callable[[str, ArrayLike], None]
    ) -> None:
        """Draw what will disturb episodes: the control steps it comes with, and its sizes."""
        events = self._events(indices)
        gain = self.told.parameters["regulator_line"].gain
        rate = self.options.control_rate_hz
        for what, times, sizes in (
            ("jump", events.step_times, events.step_sizes / gain),
            ("pulse", events.pulse_times, events.pulse_forces),
        ):
            for i in range(times.shape[1]):
                put(f"{what}_step_{i}", np.ceil(times[:, i] * rate))
                put(f"{what}_{i}", sizes[:, i])
        # As many steps whatever it begins with: a pulse is as long for every controller.
        begun, lasting = np.ceil(events.pulse_times * rate), events.pulse_lengths * rate
        for i in range(begun.shape[1]):
            put(f"pulse_end_{i}", begun[:, i] + np.ceil(lasting[:, i] - 1e-9))

    def _events(self, indices: NDArray[np.int64]) -> Events:
        """What disturbs the episodes of environments."""
        drawn_by = self._keys[indices], self._episodes[indices]
        return drawn_events(self.task, self.options, *drawn_by)

    def events(self, index: int = 0) -> Events:
        """What disturbs the episode of an environment, each of shape (events,)."""
        return Events(*(row[0] for row in self._events(np.array([index]))))

    def park(self, indices: NDArray[np.int64]) -> None:
        """Put stations that broke a limit at rest until they are reset."""
        block, lane = np.divmod(indices, self.width)
        for name in (*self.record.states, "motor_voltage", "rest_motor", "size"):
            if name in self.record.places:
                self.records[block, self.record.places[name], lane] = 0.0

    # -- steps -------------------------------------------------------------------------------------

    def step(self) -> int:
        """Step all environments by `actions`; their results stand in the attributes.

        Returns:
            0 while no episode ended, else the sum of 1 if any terminated and 2 if any was
            truncated.
        Raises:
            ValueError: an action that is not finite; nothing has happened then, but to the shares
                of other threads.
        """
        if self._has_idle_lanes:
            self._idle_lanes[:] = 0
        ended = self._crew.run()
        if ended & BAD_ACTION:
            raise ValueError("action must be finite")
        return ended

    def close(self) -> None:
        """End the threads."""
        self._crew.close()

    def advance(self, copy: Callable[[], Any], given: NDArray[np.float64]) -> Callable[[Any], Any]:
        """The step of a single environment, as fast as Python can call it.

        Args:
            copy: makes the observation that is handed out.
            given: the row of `actions`.
        Returns:
            What takes an action, or `given` with the action in it, and gives observation, reward,
            False, False and info; or, where the episode ended or an action was not finite, what
            `step` of the kernel returns: 1 if it was terminated, 2 if truncated, or BAD_ACTION; or
            NOT_READ for an action that is not an array of as many floats, with nothing done.
        """
        keys, known = self.record.info, arrays.are_known()
        bound = {
            "arguments": self._address,
            "infos": dict.fromkeys(keys),
            "keys": tuple(keys),
            "copy": copy,
            "no": False,
            "yes": True,
            "given": given,
            "array": np.ndarray if known else None,
            "single": np.dtype(np.float32),
            "double": np.dtype(np.float64),
        }
        address = self.kernel.library.address("advance")
        return builtin(address, "advance", tuple(bound[name] for name in BOUND))

    @property
    def attempts(self) -> int:
        """Attempts at internal steps in the last step, all lanes of a block counted as one."""
        return int(self._attempts[:, 0].sum())
