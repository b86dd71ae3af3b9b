"""Simulation of measured trials by a model at many values of its free parameters.

Every trial begins in equilibrium at its first commands. If the initial hysteresis state, or the
initial speed of a free rig, is unknown, each trial is simulated again with another initial state,
and a linear combination of both simulations fits the measurements.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.effects.ports import SENSOR_DELAY
from pma_gym.estimation import initial_states
from pma_gym.estimation.logged import Logged, free_parameters
from pma_gym.integrator.equations import Interpolation, check_interpolation
from pma_gym.plant import memory_start, sensors
from pma_gym.plant.compiled_model import DEFAULT_TOLERANCE
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
        tolerance: tolerance of the integrator, as in `Plant`.
        interpolation: of the commands between rows: "foh" (first-order hold, linear) or "zoh" (each
            held until the next).
        threads: how many threads share the work; the results' bits do not depend on it.

    Attributes:
        free: the free parameters.
        factors: SI value of one unit in files of each, shape (p,).
        start: their values in the model, in file units, shape (p,).
        count: number of measurements in use.
        deviations: standard deviations of the sensors (SI), shape (signals,).
        trials: number of trials.
        balanced: whether each of the last parameter values has an equilibrium at the start of
            trials.
        attempts: steps of the integrator so far; all lanes of a SIMD register count as one.
    Raises:
        ModelError: a path that the model does not have, a row of numbers or a sensor's noise.
        ValueError: no trial, or one without measurements.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        free: Sequence[str],
        tolerance: float = DEFAULT_TOLERANCE,
        interpolation: Interpolation = "foh",
        threads: int = 1,
    ) -> None:
        check_interpolation(interpolation)
        self.plant, self.threads = Plant(model, tolerance), threads
        self._ports = {effect.port for effect in model.effects.values()}
        self.interpolation: Interpolation = interpolation
        self.free = free_parameters(self.plant.model, free)
        indices = [parameter.place for parameter in self.free]
        self.factors = np.array([parameter.quantity.factor for parameter in self.free])
        self.start: Array = self.plant.vector[indices] / self.factors
        self.lower = np.array([parameter.quantity.lower for parameter in self.free], float)
        self.upper = np.array([parameter.quantity.upper for parameter in self.free], float)
        self.deviations: Array = sensors.deviations(self.plant.model)
        self.trials = len(trials)
        if not trials:
            raise ValueError("a fit needs at least one trial")
        self._trials = [Logged.of(self.plant.model, i, trial) for i, trial in enumerate(trials)]
        self.count = sum(logged.count for logged in self._trials)
        self._buffer, self.attempts = np.empty(0), 0
        self.balanced: NDArray[np.bool_] = np.ones(1, bool)
        self._own: list[tuple[int, Array]] = []
        self._start_values: list[tuple[int, Array]] = []
        if self.plant.model.rig.is_free:
            where, speed = initial_states.starts(trials, self._trials)
            paths = dict(
                zip(self.plant.model.rig.start_paths.values(), (where, speed), strict=True)
            )
            self._start_values = self._indices({path: list(row) for path, row in paths.items()})
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

        def trials(
            block: list[int], spaces: list[Array], zeros: Array, vectors: Array
        ) -> list[Array]:
            logs = [self._trials[i] for i in block]
            numbers = sum(space.shape[0] * space.shape[1] for space in spaces) / len(spaces)
            if self.threads == 1 or numbers < WORTH_A_THREAD:
                return list(map(work, logs, spaces, zeros, repeat(vectors)))
            with ThreadPoolExecutor(self.threads) as pool:
                return list(pool.map(work, logs, spaces, zeros, repeat(vectors)))

        return self._by_block(tried, trials)

    def _by_block(
        self, tried: Array, work: Callable[[list[int], list[Array], Array, Array], list[Array]]
    ) -> list[Array]:
        """As `_each`, but `work` gets several trials at once, by their numbers."""
        vectors = np.repeat(self.plant.vector[None, :], len(tried), axis=0)
        for column, parameter in enumerate(self.free):
            vectors[:, parameter.place] = tried[:, column] * self.factors[column]
        moved = self._moved_starts()
        count, number = len(tried) + len(moved), len(self.plant.states)
        every = self._every(np.concatenate([vectors, *([vectors[:1]] * len(moved))]))
        for further, indices in enumerate(moved, len(tried)):
            for place, move in indices:
                every[further::count, place] += move
        tables = self._tables(every, count)
        first = np.array([logged.first for logged in self._trials])
        commands = np.repeat(first, count, axis=0).T
        states, zeros = solver.equilibria_at(self.plant, commands[0], commands[1], every)
        results: list[Array] = []
        shape = (len(self._trials), count)
        finite = np.isfinite(zeros) & np.isfinite(states).all(axis=1)
        self._settled = bool(finite.all())
        self.balanced = np.asarray(finite.reshape(shape).all(axis=0))
        if not self._settled:
            return results
        states, zeros = states.reshape(*shape, number), zeros.reshape(shape)
        for block in self._blocks(8 * number * count):
            spaces = self._spaces(block, count)
            batches = [
                self._batch(i, tables[i], states[i], zeros[i], space)
                for i, space in zip(block, spaces, strict=True)
            ]
            self.attempts += simulate_batches(self.plant.program, batches, self.threads)
            if self._start_values:
                spaces = self._met_freely(block, spaces, zeros, vectors, every, tables)
            elif moved:
                each = zip(block, spaces, strict=True)
                spaces = [self._met(i, space, zeros[i], vectors) for i, space in each]
            results += work(block, spaces, zeros[block, : len(tried)], vectors)
        return results

    def _moved_starts(self) -> list[list[tuple[int, float]]]:
        """Parameters that say how trials begin, moved in one more simulation each, and by how much.

        A position whose zero is free begins anywhere.
        """
        if self._start_values:
            free = self.plant.model.rig.signals[0].has_free_zero
            return [[(place, initial_states.MOVE)] for place, _ in self._start_values[free:]]
        return [[(place, memory_start.MOVE) for place, _ in self._memories]] * bool(self._memories)

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
        return (left / self.deviations[:, None]).reshape(len(left), -1)

    def _met_freely(
        self,
        block: list[int],
        spaces: list[Array],
        zeros: Array,
        vectors: Array,
        every: Array,
        tables: Sequence[Array],
    ) -> list[Array]:
        """States of a free rig's trials, begun as fits best; shape (tried, rows, states) each.

        Args:
            block: the trials.
            spaces: their states, with other starts in the last ones.
            zeros: x0 in each simulation of every trial.
            vectors: parameters that were tried.
            every: parameters of every trial in each simulation, its start among them.
            tables: of every trial.
        """
        count, tried, levels = zeros.shape[1], len(vectors), self.deviations
        further = count - tried
        last = np.concatenate([vectors, *([vectors[:1]] * further)])
        logs = [self._trials[i] for i in block]
        readings = [
            self._held(space, zeros[i], last, logged.channels)
            for i, logged, space in zip(block, logs, spaces, strict=True)
        ]
        corrections = initial_states.meet(spaces, readings, logs, levels, further)
        for i, space, correction in zip(block, spaces, corrections, strict=True):
            if correction.rough:
                of = slice(i * count, (i + 1) * count)
                self._begun_again(i, space, zeros[i], last, every[of], tables[i], correction)
        position = self.plant.model.rig.signals[0]
        if position.has_free_zero and f"{SENSOR_DELAY}{position.name}" in self._ports:
            for logged, space in zip(logs, spaces, strict=True):
                column = self.plant.sensor_columns[0]
                initial_states.put_zero(space[:tried, :, column], logged)
        return [space[:tried] for space in spaces]

    def _begun_again(
        self,
        number: int,
        space: Array,
        zeros: Array,
        last: Array,
        every: Array,
        tables: Array,
        met: initial_states.Correction,
    ) -> None:
        """Begin a trial again from where it was corrected to, until its equations hardly bend.

        Args:
            number: of the trial.
            space: its states, with other starts in the last ones; changed in place.
            zeros: x0 of each.
            last: parameters of each simulation, less what the trial has of its own.
            every: those with it.
            tables: of each simulation.
            met: the first correction.
        """
        logged, further = self._trials[number], len(met.moves)
        tried = len(space) - further
        for _ in range(initial_states.RESTARTS):
            before = space[:tried].copy()
            for (place, _), move in zip(
                self._start_values[-further:], met.moves.tolist(), strict=True
            ):
                every[:, place] += initial_states.MOVE * move
            first = np.repeat([logged.first], len(space), axis=0).T
            states, zeros[:] = solver.equilibria_at(self.plant, first[0], first[1], every)
            batch = self._batch(number, tables, states, zeros, space)
            self.attempts += simulate_batches(self.plant.program, [batch], self.threads)
            readings, least = self._held(space, zeros, last, logged.channels), met.misfit
            (met,) = initial_states.meet([space], [readings], [logged], self.deviations, further)
            if not met.misfit < least:
                # Where dry friction sticks, no move of the start tells what the next one does.
                space[:tried] = before
                return
            if not met.rough:
                return

    def _batch(
        self, number: int, tables: Array, states: Array, zeros: Array, space: Array
    ) -> Batch:
        """Simulations of a trial from states, with tables and x0 of each, into `space`."""
        logged = self._trials[number]
        time, motor, regulator = (
            np.ascontiguousarray(column, float)
            for column in (logged.time, logged.motor, logged.regulator)
        )
        return Batch(time, motor, regulator, self.interpolation, tables, states, zeros, space)

    def _every(self, vectors: Array) -> Array:
        """Parameters of every trial at each of some, shape (trials * tried, numbers)."""
        every = np.tile(vectors, (len(self._trials), 1))
        for place, values in (*self._start_values, *self._memories, *self._own):
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
            read: which signals are asked for, all if not given; the others are zeros.
        """
        columns, program = self.plant.sensor_columns, self.plant.program
        asked = range(len(columns)) if read is None else read
        count, rows, _ = states.shape
        truth = np.empty((0, 0, 0))
        if min([columns[at] for at in asked]) < 0:
            truth = np.empty((count, rows, len(self.plant.outputs)))
            here, there, of = (each.ctypes.data for each in (states, truth, vectors))
            for i, zero in enumerate(zeros.tolist()):
                program.observe(
                    rows,
                    here + i * states.strides[0],
                    zero,
                    of + i * vectors.strides[0],
                    there + i * truth.strides[0],
                )
        unread = truth if len(asked) == len(columns) else np.zeros((count, rows))
        readings = [unread] * len(columns)
        for signal in asked:
            at = columns[signal]
            readings[signal] = states[:, :, at] if at >= 0 else truth[:, :, signal]
        return readings
