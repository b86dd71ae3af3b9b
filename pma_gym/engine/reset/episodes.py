"""Resets of episodes: random draws, equilibrium and disturbances."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.engine.cpu.block_memory import ARGUMENTS
from pma_gym.engine.engine_memory import EngineMemory
from pma_gym.engine.nominal_rig import motor_at_rest, nominal_model, rig_model
from pma_gym.engine.option_checks import Pressure
from pma_gym.engine.options import Options
from pma_gym.engine.reset.reset_state import (
    Settled,
    check_prescription,
    drawn_events,
    drawn_pressures,
    hangs_slack,
    holding_voltages,
    operators,
    settled_at_no_load,
    settled_under_load,
    wound_back,
)
from pma_gym.engine.state_layout import START
from pma_gym.plant.compiled_model import regulator_voltage
from pma_gym.plant.equilibrium.solver import NoLoadEquilibria
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import FIRST_S, vector
from pma_gym.tasks import Events, Task

FIRST, LAST, SETTLES = (ARGUMENTS.index(name) for name in ("first", "last", "settles"))
"""Places in a beginning's arguments: of which indices, and whether it draws pressures itself."""

_DRAWN_BY = "key_0", "key_1", "episode"


class Episodes(EngineMemory):
    """Begin episodes; see `Engine` for arguments and attributes."""

    def __init__(
        self,
        task: Task,
        options: Options,
        count: int,
        single: bool,
        pressures: Sequence[Pressure] | None,
    ) -> None:
        """Check the pressures that are asked for, then compile."""
        self.task, self.nominal_model = task, nominal_model(task, options.nominal)
        # The very same model where nothing is added: its plant is known by that.
        rig = self._rig_model(replace(options, model=self.nominal_model))
        nominal = Plant(rig, options.tolerance)
        self.rest_motor = motor_at_rest(self.nominal_model, task)
        usual = [options.pressure_kpa] * count if pressures is None else pressures
        self.wanted = tuple(usual)
        self._possible: set[str] = set()
        self._check_prescription(self.wanted)
        super().__init__(task, options, self.nominal_model, nominal, count, single)
        self._rest = NoLoadEquilibria(self.nominal)
        self._settling = self._slack_range()
        self.set_pressures({})
        self._reset_arguments = self._arguments.copy()
        # Of steps, which have theirs elsewhere.
        self._reset_arguments[ARGUMENTS.index("attempts")] = 0
        self._reset_address = self._reset_arguments.ctypes.data

    def _rig_model(self, options: Options) -> Model:
        """The nominal model with the effects of task and options."""
        return rig_model(self.task, options)

    def seed(self, indices: NDArray[np.int64], seeds: Sequence[int | None]) -> None:
        """Seed the random numbers of environments; None keeps an environment's present seed."""
        for index, seed in zip(indices.tolist(), seeds, strict=True):
            if seed is not None or not self.is_seeded(index):
                self._keys[index] = np.random.SeedSequence(seed).generate_state(2)
                self._episodes[index] = -1
                block, lane = divmod(index, self.width)
                for name, number in zip(_DRAWN_BY, (*self._keys[index], -1), strict=True):
                    self.integers[block, self.state_layout.offsets[name], lane] = number

    def is_seeded(self, index: int) -> bool:
        """Whether an environment has a seed."""
        return bool(self._episodes[index] >= 0 or self._keys[index].any())

    def set_pressures(self, wanted: Mapping[int, Pressure]) -> None:
        """Begin later episodes of some environments at other pressures.

        Args:
            wanted: as the option `pressure_kpa`, by the index of the environment.
        Raises:
            ValueError: an exercise's device cannot give what is prescribed there.
        """
        self._check_prescription(wanted.values())
        self.wanted = tuple(wanted.get(i, one) for i, one in enumerate(self.wanted))
        self._usual = self._ranges.copy() if self._settles(self.wanted) else None

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
        try:
            self._draw_tasks(indices)
            if wanted is None and self._usual is not None:
                settles, self._ranges[:count] = True, self._usual[indices]
            else:
                usual = [self.wanted[i] for i in indices.tolist()]
                asked = usual if wanted is None else list(wanted)
                settles = self._settles(asked)
                if not settles:
                    self._begin_drawn(indices, asked)
        except BaseException:
            # The next one that can begin is this one.
            self._episodes[indices] -= 1
            raise
        self._indices[:count] = indices
        self._begin(count, settles)
        if settles and count == self.count:
            self.pressures[:] = self.numbers("pressure")
        elif settles:
            self.pressures[indices] = self._of("pressure", indices)

    def _begin(self, count: int, settles: bool) -> None:
        """Have compiled code begin the episodes of the first `count` indices."""
        self._reset_arguments[LAST], self._reset_arguments[SETTLES] = count, settles
        self.kernel.begin(self._reset_address, None)

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

    def _check_prescription(self, wanted: Iterable[Pressure]) -> None:
        """Refuse pressures at which an exercise's device cannot give what is prescribed."""
        if self.task.exercise is None:
            return
        new = {repr(one): one for one in wanted if repr(one) not in self._possible}
        check_prescription(self.task, self.nominal_model, new.values())
        self._possible |= set(new)

    def _drawn_models(self, indices: NDArray[np.int64]) -> NDArray[np.float64] | None:
        """Draw the stations of episodes; their vectors, or None if all are nominal."""
        if self._shares_table:
            return None
        draw = self.options.draw
        rows = []
        for index in indices.tolist():
            self.models[index] = self._checked(draw(self.nominal.model, self._generator(index, 0)))
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
            wound_back(self.state_layout.states, states, zero, radii)
        return states, zero

    def _fill(
        self,
        indices: NDArray[np.int64],
        states: NDArray[np.float64],
        zero: NDArray[np.float64],
        regulator: NDArray[np.float64],
    ) -> None:
        offsets, size = self.state_layout.offsets, self.state_layout.size
        rows = np.zeros((len(indices), size))
        wholes = rows.view(np.int64)

        def put(name: str, values: ArrayLike) -> None:
            rows[:, offsets[name]] = values

        rows[:, : len(self.state_layout.states)] = states
        put("size", FIRST_S)
        put("zero_contraction", zero)
        put("regulator_voltage", regulator)
        put("rest_regulator", regulator)
        for i in range(2):
            wholes[:, offsets[f"key_{i}"]] = self._keys[indices, i]
        wholes[:, offsets["episode"]] = self._episodes[indices]
        held = np.maximum(np.minimum(0.2 * regulator - 1.0, 1.0), -1.0)
        volts: list[ArrayLike] = [0.0, regulator]
        actions: list[ArrayLike] = [-1.0, held]
        if self.task.actuator == "regulator":
            for name in ("motor_voltage", "rest_motor"):
                put(name, self.rest_motor)
            put(START, states[:, self.state_layout.states.index("contraction")])
            volts, actions = volts[1:], actions[1:]
        for i in range(self.state_layout.actions):
            put(f"action_{i}", actions[i])
            for k in range(self.options.action_delay):
                put(f"wire_{k}_{i}", volts[i])
        if self.state_layout.events:
            self._put_events(indices, put)
        if self.task.exercise:
            drawn_by = self._keys[indices], self._episodes[indices], self.pressures[indices]
            numbers = operators(self.task, self.options, self.nominal_model, *drawn_by, regulator)
            for name, values in numbers.items():
                put(name, values)
        block, lane = np.divmod(indices, self.width)
        self.records[block, :, lane] = rows

    def _put_events(
        self, indices: NDArray[np.int64], put: Callable[[str, ArrayLike], None]
    ) -> None:
        """Draw what will disturb episodes: the control steps it comes with, and its sizes."""
        events = self._events(indices)
        line = self.nominal_model.parameters.get("regulator_line")
        gain = line.gain if line else 1.0
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
        """Return the disturbances of an environment's episode, each of shape (events,)."""
        return Events(*(row[0] for row in self._events(np.array([index]))))

    def park(self, indices: NDArray[np.int64]) -> None:
        """Put stations that broke a limit at rest until they are reset."""
        block, lane = np.divmod(indices, self.width)
        for name in (*self.state_layout.states, "motor_voltage", "rest_motor", "size"):
            if name in self.state_layout.offsets:
                self.records[block, self.state_layout.offsets[name], lane] = 0.0
