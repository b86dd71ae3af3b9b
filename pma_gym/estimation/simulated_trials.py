"""Simulation of measured trials by a model at many values of its free parameters.

Every trial begins in equilibrium at its first commands. If the initial hysteresis state is unknown,
each trial is simulated again with another one, and a linear combination of both simulations fits
the measurements.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.estimation.logged import Logged, free_parameters
from pma_gym.plant import memory_start
from pma_gym.plant.equilibrium import solver
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import table
from pma_gym.plant.simulation import Batch, simulate_batches

Array = NDArray[np.float64]

MOST_BYTES = 1 << 28
"""Largest memory for the states of trials that are simulated together."""

WORTH_A_THREAD = 30_000
"""Rows of a trial, times the parameter values tried, from which on its work is worth a thread: of
pieces of 1000 rows two threads make two thirds of the speed of one."""


class SimulatedTrials:
    """Simulate measured trials with any values of a model's free parameters.

    Args:
        model: the model; its drive and regulator convert commanded loads and pressures to
            voltages.
        trials: the trials, with measurements.
        free: paths of the free parameters.
        threads: how many threads share the work; the results' bits do not depend on it.

    Attributes:
        free: the free parameters.
        factors: SI value of one unit in files of each, shape (p,).
        start: their values in the model, in file units, shape (p,).
        count: number of measurements in use.
        balanced: whether each of the last parameter values has an equilibrium at the start of
            trials.
        attempts: steps of the integrator so far; all lanes of a SIMD register count as one.
    Raises:
        ValueError: a trial without measurements.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        free: Sequence[str],
        threads: int = 1,
    ) -> None:
        self.plant, self.threads = Plant(model), threads
        self.free = free_parameters(self.plant.model, free)
        indices = [parameter.place for parameter in self.free]
        self.factors = np.array([parameter.quantity.factor for parameter in self.free])
        self.start: Array = self.plant.vector[indices] / self.factors
        self.lower = np.array([parameter.quantity.lower for parameter in self.free], float)
        self.upper = np.array([parameter.quantity.upper for parameter in self.free], float)
        self._trials = [Logged.of(self.plant.model, i, trial) for i, trial in enumerate(trials)]
        self.count = sum(logged.count for logged in self._trials)
        self._buffer, self.attempts = np.empty(0), 0
        self.balanced: NDArray[np.bool_] = np.ones(1, bool)
        self._own: list[tuple[int, Array]] = []
        guesses = memory_start.first_guesses(trials)
        nuisances = [p for p in memory_start.memory_starts(self.plant.model) if p not in free]
        self._memories = self._indices({path: list(guesses) for path in nuisances})
        self._reaches = [memory_start.reach(trial) for trial in trials]

    def _each(
        self, tried: Array, work: Callable[[Logged, Array, Array, Array], Array]
    ) -> list[Array]:
        """Simulate all trials at all parameters; what `work` makes of each trial, in their order.

        It gets states of shape (tried, rows, states), x0 of shape (tried,) and their vectors.
        """
        count = len(tried)
        vectors = np.repeat(self.plant.vector[None, :], count, axis=0)
        for column, parameter in enumerate(self.free):
            vectors[:, parameter.place] = tried[:, column] * self.factors[column]
        moved = bool(self._memories)
        every = self._every(np.concatenate([vectors, vectors[:moved]]))
        for place, _ in self._memories:
            every[count :: count + 1, place] += memory_start.MOVE
        tables = self._tables(every, count + moved)
        first = np.array([logged.first for logged in self._trials])
        commands = np.repeat(first, count + moved, axis=0).T
        states, zeros = solver.equilibria_at(self.plant, commands[0], commands[1], every)
        results: list[Array] = []
        shape, number = (len(self._trials), count + moved), len(self.plant.states)
        finite = np.isfinite(zeros) & np.isfinite(states).all(axis=1)
        self._settled = bool(finite.all())
        self.balanced = np.asarray(finite.reshape(shape).all(axis=0))
        if not self._settled:
            return results
        states, zeros = states.reshape(*shape, number), zeros.reshape(shape)
        for block in self._blocks(8 * number * shape[1]):
            spaces = self._spaces(block, shape[1])
            batches = [
                self._batch(i, tables[i], states[i], zeros[i], space)
                for i, space in zip(block, spaces, strict=True)
            ]
            self.attempts += simulate_batches(self.plant.program, batches, self.threads)
            if moved:
                each = zip(block, spaces, strict=True)
                spaces = [self._met(i, space, zeros[i], vectors) for i, space in each]
            results += self._worked(block, spaces, zeros[block, :count], vectors, work)
        return results

    def _worked(
        self,
        block: list[int],
        spaces: list[Array],
        zeros: Array,
        vectors: Array,
        work: Callable[[Logged, Array, Array, Array], Array],
    ) -> list[Array]:
        """What `work` makes of the trials of a block, by threads where it is worth them."""
        logs = [self._trials[i] for i in block]
        numbers = sum(space.shape[0] * space.shape[1] for space in spaces) / len(spaces)
        if self.threads == 1 or numbers < WORTH_A_THREAD:
            return list(map(work, logs, spaces, zeros, repeat(vectors)))
        with ThreadPoolExecutor(self.threads) as pool:
            return list(pool.map(work, logs, spaces, zeros, repeat(vectors)))

    def _met(self, number: int, space: Array, zeros: Array, vectors: Array) -> Array:
        """States of a trial that begins as fits best, shape (tried, rows, states).

        The last of those given are the first with another start; x0 moves with them.
        """
        shares = self._start_shares(number, space, zeros, vectors)
        space[:-1] += shares[:, None, None] * (space[-1] - space[0])
        zeros[:-1] += shares * (zeros[-1] - zeros[0])
        return space[:-1]

    def _start_shares(self, number: int, space: Array, zeros: Array, vectors: Array) -> Array:
        """Multiple of the move that brings each simulation nearest to the readings, (tried,)."""
        logged = self._trials[number]
        readings = self._held(space, zeros, np.concatenate([vectors, vectors[:1]]), logged.channels)
        left = np.stack(readings, axis=1) - logged.measured
        changes = self._in_noise(logged, left * logged.counts)
        along = changes[-1] - changes[0]
        return memory_start.best_shares(changes[:-1], along, self._reaches[number])

    def _in_noise(self, logged: Logged, left: Array) -> Array:
        """Differences (SI), (tried, signals, rows), in units of noise, (tried, numbers)."""
        raise NotImplementedError

    def _batch(
        self, number: int, tables: Array, states: Array, zeros: Array, space: Array
    ) -> Batch:
        """Simulations of a trial from states, with tables and x0 of each, into `space`."""
        logged = self._trials[number]
        time, motor, regulator = (
            np.ascontiguousarray(column, float)
            for column in (logged.time, logged.motor, logged.regulator)
        )
        return Batch(time, motor, regulator, "foh", tables, states, zeros, space)

    def _every(self, vectors: Array) -> Array:
        """Parameters of every trial at each of some, shape (trials * tried, numbers)."""
        every = np.tile(vectors, (len(self._trials), 1))
        for place, values in (*self._memories, *self._own):
            every[:, place] = np.repeat(values, len(vectors))
        return every

    def _tables(self, every: Array, count: int) -> Sequence[Array]:
        """Tables of every trial; the same ones where trials have no parameters of their own."""
        program, trials = self.plant.program, len(self._trials)
        if not self._own:
            return [np.stack([table(program, vector) for vector in every[:count]])] * trials
        tables = np.stack([table(program, vector) for vector in every])
        return list(tables.reshape(trials, count, -1))

    def _indices(self, own: Mapping[str, Sequence[float]]) -> list[tuple[int, Array]]:
        """Where values (SI) go that a parameter has in each trial, by its path."""
        free = free_parameters(self.plant.model, list(own))
        return [(each.place, np.asarray(own[each.path], float)) for each in free]

    def _blocks(self, bytes_a_row: int) -> list[list[int]]:
        """Trials that fit into memory together."""
        blocks, room = [], 0
        for i, logged in enumerate(self._trials):
            needed = bytes_a_row * len(logged.time)
            if not blocks or needed > room:
                blocks.append([])
                room = MOST_BYTES
            blocks[-1].append(i)
            room -= needed
        return blocks

    def _spaces(self, block: list[int], count: int) -> list[Array]:
        """Room for the states of a block's trials, shape (count, rows, states) each; used again."""
        shapes = [(count, len(self._trials[i].time), len(self.plant.states)) for i in block]
        ends = np.cumsum([math.prod(shape) for shape in shapes])
        if len(self._buffer) < ends[-1]:
            self._buffer = np.empty(ends[-1])
        parts = np.split(self._buffer[: ends[-1]], ends[:-1])
        return [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]

    def _held(
        self, states: Array, zeros: Array, vectors: Array, read: Sequence[int] | None = None
    ) -> list[Array]:
        """Sensor values, shape (tried, rows) each.

        Args:
            states: shape (tried, rows, states), contiguous.
            zeros: x0 of each.
            vectors: parameters of each, contiguous.
            read: which signals are asked for; all if not given.
        """
        columns, program = self.plant.sensor_columns, self.plant.program
        count, rows, _ = states.shape
        truth = np.zeros((count, rows, len(columns)))
        if min(columns if read is None else [columns[at] for at in read]) < 0:
            here, there, of = (each.ctypes.data for each in (states, truth, vectors))
            for i, zero in enumerate(zeros.tolist()):
                program.observe(
                    rows,
                    here + i * states.strides[0],
                    zero,
                    of + i * vectors.strides[0],
                    there + i * truth.strides[0],
                )
        return [states[:, :, at] if at >= 0 else truth[:, :, k] for k, at in enumerate(columns)]
