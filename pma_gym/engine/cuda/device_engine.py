"""Environments in the memory of a device: a GPU, or its emulation.

The device computes everything, including resets, without copies to or from the host. If stations
are randomised or disturbed, or their cable is taut at rest, the processor computes the resets; a
step then waits for the flags of ended episodes.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.cuda.kernel import THREADS, CudaKernel, Name
from pma_gym.engine.engine import Engine
from pma_gym.engine.nominal_rig import rig_model
from pma_gym.engine.observation import ObservationTable
from pma_gym.engine.options import Options
from pma_gym.engine.reset.reset_state import hangs_slack
from pma_gym.engine.state_layout import StateLayout
from pma_gym.plant.compiled_model import regulator_voltage
from pma_gym.plant.equilibrium import solver
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import vector
from pma_gym.tasks import Task

Array = Any
"""An array of the device: a torch tensor, or a NumPy array."""


class Device(Protocol):
    """Interface of a device that stores arrays and runs a kernel's functions."""

    def zeros(self, shape: tuple[int, ...], kind: type[np.generic]) -> Array:
        """An array of zeros."""
        ...

    def put(self, array: NDArray[Any]) -> Array:
        """A copy of an array."""
        ...

    def view(self, array: Array, kind: type[np.generic]) -> Array:
        """The same memory as another type of the same size."""
        ...

    def indices(self, flags: Array) -> NDArray[np.int64]:
        """Indices of set flags; waits for the device."""
        ...

    def actions(self, given: object, shape: tuple[int, int], kind: type[np.generic]) -> Array:
        """Actions as an array of the device, checked for shape."""
        ...

    def address(self, array: Array) -> int:
        """Address of an array."""
        ...

    def prepare(self, kernel: CudaKernel) -> None:
        """Compile a kernel."""
        ...

    def launch(self, name: Name, given: Mapping[str, int], table: NDArray[Any]) -> None:
        """Run a function of the kernel for all environments."""
        ...


class DeviceEngine:
    """Hold the state of n environments on a device and step them.

    An episode that ends is followed by the next one at once: its last observation stands in
    `final_observations`, its reward and flags where they always do, and `observations` has the
    first of the next. The arrays are the engine's own and change with every step.

    Args:
        task: the task.
        options: the options, the same for all.
        count: how many environments.
        precision: `double`: the bits of `Engine`, where the device rounds as IEEE 754 has it; or
            `single`, see `pma_gym.engine.cuda.engine`.
        device: where.

    Attributes:
        observations: float32, shape (n, entries).
        rewards: shape (n,).
        terminated: bool, shape (n,); `truncated` too.
        final_observations: of the episode that ended last, float32, shape (n, entries).
        scores: of the episode that ended last: samples, code of the limit that was broken, and sums
            of squared errors (m^2 or rad^2) by phase; shape (2 + phases, n).
        attempts: attempts at internal steps by each thread in the last step, int32; at least n.
    """

    def __init__(
        self, task: Task, options: Options, count: int, precision: str, device: Device
    ) -> None:
        """Compile, and allocate arrays."""
        if precision not in ("double", "single"):
            raise ValueError(f"precision must be double or single, got {precision!r}")
        if callable(options.reward):
            raise ValueError(
                "reward must be a name where a device computes it, got a function, which Python "
                "calls; take PMAVectorEnv, or compute rewards from the observations"
            )
        self.task, self.options, self.count, self._device = task, options, count, device
        self.nominal = Plant(rig_model(task, options), options.tolerance)
        self.state_layout = StateLayout(tuple(self.nominal.states), task, options)
        self.table = ObservationTable(task, options)
        self._own_tables = options.randomisation != "none"
        pressures = self._pressures()
        # What comes beside pressure and rest is drawn by the processor.
        undisturbed = (
            not self._own_tables and not self.state_layout.events and task.actuator == "motor"
        )
        self._draws = undisturbed and self._hangs_slack(pressures)
        self.kernel = CudaKernel(
            self.nominal.program,
            self.state_layout,
            self.table,
            precision == "single",
            self._own_tables,
            self._draws,
            options.pressure_kpa == "random",
        )
        device.prepare(self.kernel)
        self._allocate(pressures)
        self._host = None if self._draws else Engine(task, options, count)
        self._begun = False

    def __reduce__(self) -> NoReturn:
        """Raise an error, because the state is on a device, at addresses of this process."""
        raise TypeError(
            f"a {type(self).__name__} cannot be copied or pickled, its numbers lie on a device; "
            "make another one of the same options and reset both with the same seed, or take a "
            "PMAVectorEnv, which can be"
        )

    def _pressures(self) -> NDArray[np.float64]:
        """Range of the episodes' pressures, or those they are drawn from (Pa)."""
        wanted = self.options.pressure_kpa
        if isinstance(wanted, str):
            return np.array(self.task.starts)
        several = wanted if isinstance(wanted, Sequence) else [wanted]
        return np.array([1e3 * float(one) for one in several])

    def _hangs_slack(self, pressures: NDArray[np.float64]) -> bool:
        """Whether stations at rest are what `begin` takes them for."""
        low, high = float(pressures.min()), float(pressures.max())
        for pressure in (low, high):
            # Refuses what the regulator does not reach.
            regulator_voltage(self.nominal.model, pressure)
        return hangs_slack(solver.NoLoadEquilibria(self.nominal), low, high)

    def _allocate(self, pressures: NDArray[np.float64]) -> None:
        made, kernel, n = self._device, self.kernel, self.count
        zeros, entries = made.zeros, len(self.table.rows)
        self.records = zeros((len(kernel.offsets), n), kernel.element)
        self._whole = made.view(self.records, kernel.whole)
        own = (kernel.table_size, n) if self._own_tables else (1, 1)
        self.tables = zeros(own, kernel.element)
        self._shared = kernel.table(self.nominal.vector)
        self._references = made.put(
            np.pad(self.table.references, (0, 2), mode="edge").astype(kernel.element)
        )
        steps = self.task.steps(self.options.control_rate_hz)
        moves = self.task.schedule.motion is not None
        samples = int((steps + 2) * self.options.period * 384.0) + 8 if moves else 1
        self._ideals = made.put(self.task.ideals(samples).astype(kernel.element))
        self.observations = zeros((n, entries), np.float32)
        self.final_observations = zeros((n, entries), np.float32)
        self.rewards = zeros((n,), kernel.element)
        self.terminated, self.truncated = (zeros((n,), np.bool_) for _ in range(2))
        phases = self.task.schedule.phases
        self.scores = zeros((2 + len(phases), n), kernel.element)
        self._scored = ["sample", "ended", *(f"sum_{phase.name}" for phase in phases)]
        self._faults = zeros((1,), np.int32)
        # The last block may have threads beyond the last environment.
        self.attempts = zeros((n + THREADS,), np.int32)
        self._pressure = made.put(pressures)
        given = {
            "records": self.records,
            "tables": self.tables,
            "references": self._references,
            "ideals": self._ideals,
            "actions": self._references,
            "observations": self.observations,
            "rewards": self.rewards,
            "terminated": self.terminated,
            "truncated": self.truncated,
            "faults": self._faults,
            "attempts": self.attempts,
            "finals": self.final_observations,
            "scores": self.scores,
            "pressures": self._pressure,
        }
        self._given = {name: made.address(array) for name, array in given.items()}
        self._given |= {
            "count": n,
            "choices": len(pressures),
            "horizon": self.options.horizon(self.task),
        }

    # -- episodes ----------------------------------------------------------------------------------

    def reset(self, seed: int | Sequence[int] | None = None, mask: Array | None = None) -> Array:
        """Begin episodes.

        Args:
            seed: seed of the first environment, the others counting up from it; or one each. None
                goes on with the random numbers at hand.
            mask: which environments, bool of shape (n,), an array of the device; all if not given.
        Returns:
            The observations.
        """
        self._seed(seed)
        if self._draws:
            flags = self._every() if mask is None else mask
            at = self._device.address(flags)
            given = {**self._given, "terminated": at, "truncated": at}
            self._device.launch("begin", given, self._shared)
        else:
            every = np.arange(self.count)
            self._begin_on_host(every if mask is None else self._device.indices(mask))
        self._begun = True
        return self.observations

    def _every(self) -> Array:
        flags = self._device.zeros((self.count,), np.bool_)
        flags[:] = True
        return flags

    def _seed(self, seed: int | Sequence[int] | None) -> None:
        """Begin the random numbers of all environments anew."""
        if seed is None and self._begun:
            return
        seeds: list[int | None] = [None] * self.count
        if isinstance(seed, int | np.integer):
            seeds = [int(seed) + i for i in range(self.count)]
        elif seed is not None:
            seeds = list(seed)
        if len(seeds) != self.count:
            raise ValueError(
                f"seed must be a whole number, or one for each of the {self.count} environments; "
                f"got {len(seeds)}"
            )
        if self._host is not None:
            self._host.seed(np.arange(self.count), seeds)
            return
        if seed is None:
            # Nobody can ask for these again: one source for all.
            drawn = np.random.SeedSequence().generate_state(2 * self.count).reshape(-1, 2)
        else:
            drawn = np.array([np.random.SeedSequence(one).generate_state(2) for one in seeds])
        for i in range(2):
            key = drawn[:, i].astype(np.int64).astype(self.kernel.whole)
            self._whole[self.kernel.offsets[f"key_{i}"]] = self._device.put(key)
        self._whole[self.kernel.offsets["episode"]] = -1

    def _begin_on_host(self, indices: NDArray[np.int64]) -> None:
        """Let the processor begin episodes, and take them over."""
        if not len(indices):
            return
        host, kernel, put = self._host, self.kernel, self._device.put
        assert host is not None
        host.reset(indices)
        block, lane = np.divmod(indices, host.width)
        # As integers: not every integer is a number that keeps its bits.
        rows = np.empty((len(kernel.offsets), len(indices)), kernel.whole)
        for name, place in kernel.offsets.items():
            at = block, self.state_layout.offsets[name], lane
            if self.state_layout.kind(name) == "integer":
                rows[place] = host.integers[at]
            else:
                rows[place] = host.records[at].astype(kernel.element).view(kernel.whole)
        where = put(indices)
        self.final_observations[where] = self.observations[where]
        for i, name in enumerate(self._scored):
            self.scores[i, where] = self.records[kernel.offsets[name], where]
        self._whole[:, where] = put(rows)
        self.observations[where] = put(host.observations[indices])
        if self._own_tables:
            tables = [
                kernel.table(vector(host.models[i], self.nominal.tolerance))
                for i in indices.tolist()
            ]
            self.tables[:, where] = put(np.array(tables, kernel.element).T)

    # -- steps -------------------------------------------------------------------------------------

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array]:
        """Step all environments, and begin the next episode where one ended.

        Args:
            actions: shape (n, entries of an action), an array of the device. One that is not finite
                is not done: that environment goes on as before, and `check` will tell.
        Returns:
            observations, rewards, terminated, truncated.
        """
        if not self._begun:
            raise RuntimeError("no episode has begun: call reset() before step()")
        shape = (self.count, self.state_layout.actions)
        self._actions = self._device.actions(actions, shape, self.kernel.element)
        self._given["actions"] = self._device.address(self._actions)
        self._device.launch("step", self._given, self._shared)
        if self._draws:
            self._device.launch("begin", self._given, self._shared)
        else:
            self._begin_on_host(self._device.indices(self.terminated | self.truncated))
        return self.observations, self.rewards, self.terminated, self.truncated

    def check(self) -> None:
        """Wait for the device and raise an error for invalid actions.

        Raises:
            ValueError: an action since the last check was not finite.
        """
        if len(self._device.indices(self._faults)):
            self._faults[:] = 0
            raise ValueError(
                "actions must be finite; at least one since the last check was not; look for a "
                "division by zero or a diverged policy in what computes them"
            )

    def numbers(self, name: str) -> Array:
        """A number of every environment by its place's name (`kernel.offsets`), shape (n,)."""
        whole = self.state_layout.kind(name) == "integer"
        return (self._whole if whole else self.records)[self.kernel.offsets[name]]
