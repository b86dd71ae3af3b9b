"""What a model leaves unexplained of many trials, and how that changes with its parameters.

All trials, each with the parameters as they are and with every free one moved a little, are
simulated together. Sums over residuals are made trial by trial, so that no Jacobian of a million
rows is ever held.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.estimation import initial_states
from pma_gym.estimation.logged import Logged
from pma_gym.estimation.products import Signals, products
from pma_gym.integrator.equations import Interpolation, check_interpolation
from pma_gym.plant import memory_start, sensors
from pma_gym.plant.compiled_model import DEFAULT_TOLERANCE
from pma_gym.plant.equilibrium import solver
from pma_gym.plant.model import Model, ModelError
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import FIRST_S, parameter_names, table
from pma_gym.plant.simulation import Run, simulate_all
from pma_gym.units import Quantity

Array = NDArray[np.float64]

MOST_BYTES = 1 << 28
"""Most memory for the states of trials that are simulated together."""


@dataclass(frozen=True)
class Free:
    """A parameter that a fit may change.

    Attributes:
        path: `effect.parameter_unit`, as in `Model.paths`.
        place: its place in the vector that compiled functions read.
        quantity: its unit and bounds.
    """

    path: str
    place: int
    quantity: Quantity


@dataclass(frozen=True)
class Sums:
    """Sums over the residuals r of all trials, in units of their noise; J = dr / d(parameters).

    Attributes:
        chi_square: r.r; infinite where the model cannot be simulated.
        gradient: J^T r, shape (p,), per unit in files.
        curvature: J^T J, shape (p, p).
    """

    chi_square: float
    gradient: Array
    curvature: Array


class Residuals:
    """Measured trials beside a model whose free parameters are given.

    A residual is simulated minus measured, in standard deviations: the sensor's noise and the
    rounding of the DAQ. Sensors hold what their lag makes of the truth. NaN counts for nothing, nor
    does a reading at an end of the DAQ's range, which says only that the truth lies beyond. A trial
    begins settled at its first commands, memories where they fit it best between 0 and 1 unless the
    trial says where (`memory_start`); a rig that nothing holds, where and as fast as fits it best.

    Args:
        model: the model; its noise levels weigh the sensors, its drive and its regulator's line
            say what commanded loads and pressures are in volts.
        trials: the trials, which need measurements.
        free: paths of the free parameters.
        tolerance: of the integrator, as `Plant`.
        interpolation: of the commands between rows: "foh" (first-order hold, linear) or "zoh" (each
            held until the next).
        threads: how many threads share the work; the results' bits do not depend on it.

    Attributes:
        free: the free parameters.
        start: their values in the model, in file units, shape (p,).
        count: number of residuals.
        deviations: standard deviations of the sensors (SI), shape (signals,).
        trials: number of trials.
        balanced: which of the parameters tried last balance the load where trials begin.
    Raises:
        ModelError: a path that the model does not have, a row of numbers or a sensor's noise.
        ValueError: no trial, or one that measures nothing.
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
        self.interpolation: Interpolation = interpolation
        self.free = _free(self.plant.model, free)
        indices = [parameter.place for parameter in self.free]
        self._factors = np.array([parameter.quantity.factor for parameter in self.free])
        self.start: Array = self.plant.vector[indices] / self._factors
        self.lower = np.array([parameter.quantity.lower for parameter in self.free], float)
        self.upper = np.array([parameter.quantity.upper for parameter in self.free], float)
        self.deviations: Array = sensors.deviations(self.plant.model)
        self.trials = len(trials)
        if not trials:
            raise ValueError("a fit needs at least one trial")
        self._trials = [Logged.of(self.plant.model, i, trial) for i, trial in enumerate(trials)]
        self.count = sum(logged.count for logged in self._trials)
        self._weights = [
            [counts / width for counts, width in zip(logged.counts, self.deviations, strict=True)]
            for logged in self._trials
        ]
        self._buffer = np.empty(0)
        self.balanced: NDArray[np.bool_] = np.ones(1, bool)
        self._own: list[tuple[int, Array]] = []
        self._begun: list[tuple[int, Array]] = []
        if self.plant.model.rig.is_free:
            where, speed = initial_states.starts(self._trials)
            paths = dict(
                zip(self.plant.model.rig.start_paths.values(), (where, speed), strict=True)
            )
            self._begun = self._indices({path: list(row) for path, row in paths.items()})
        guesses = memory_start.first_guesses(trials)
        nuisances = [p for p in memory_start.memory_starts(self.plant.model) if p not in free]
        self._memories = self._indices({path: list(guesses) for path in nuisances})
        self._reaches = [memory_start.reach(trial) for trial in trials]

    def sums(self, values: Array, steps: Array, central: bool = False) -> Sums:
        """Sums at parameters, with the Jacobian by finite differences.

        Args:
            values: the parameters in file units, shape (p,).
            steps: how far each is moved, with its sign, shape (p,); or (0,) for chi-square alone.
            central: move each both ways, which costs twice as much.
        """
        size = len(steps)
        total = np.zeros((size + 1, size + 1))

        def multiply(
            block: list[int], spaces: list[Array], zeros: Array, vectors: Array
        ) -> list[Array]:
            return self._multiplied(block, spaces, zeros, vectors, central)

        for product in self._by_block(_moved(values, steps, central), multiply):
            total += product
        widths = np.concatenate([[1.0], steps])
        total /= np.outer(widths, widths)
        if not np.isfinite(total).all() or not self._settled:
            return Sums(math.inf, np.full(size, np.nan), np.full((size, size), np.nan))
        return Sums(float(total[0, 0]), total[1:, 0], total[1:, 1:])

    def each(self, values: Array) -> list[Array]:
        """Residuals of each trial at parameters, shape (rows, signals) in the order of outputs.

        Raises:
            ValueError: the model cannot balance the load at the beginning of a trial.
        """
        return [differences[0] for differences in self._dense(values, np.ones(0), central=False)]

    def jacobian(self, values: Array, steps: Array, central: bool = False) -> list[Array]:
        """Derivatives of each trial's residuals, shape (p, rows, signals), as `sums` uses them."""
        trials = self._dense(values, steps, central)
        return [differences[1:] / steps[:, None, None] for differences in trials]

    def _dense(self, values: Array, steps: Array, central: bool) -> list[Array]:
        def copy(logged: Logged, states: Array, zeros: Array, vectors: Array) -> Array:
            dense = self._differences(logged, states, zeros, vectors, central)
            return (dense / self.deviations[:, None]).transpose(0, 2, 1)

        dense = self._each(_moved(values, steps, central), copy)
        if not self._settled:
            raise ValueError("no contraction balances the load at the beginning of a trial")
        return dense

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
            with ThreadPoolExecutor(self.threads) as pool:
                # A thread costs more than the work of a small trial does.
                each = pool.map if self.threads > 1 else map
                return list(each(work, logs, spaces, zeros, repeat(vectors)))

        return self._by_block(tried, trials)

    def _by_block(
        self, tried: Array, work: Callable[[list[int], list[Array], Array, Array], list[Array]]
    ) -> list[Array]:
        """As `_each`, but `work` gets several trials at once, by their numbers."""
        vectors = np.repeat(self.plant.vector[None, :], len(tried), axis=0)
        for column, parameter in enumerate(self.free):
            vectors[:, parameter.place] = tried[:, column] * self._factors[column]
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
            runs, spaces = [], self._spaces(block, count)
            for i, space in zip(block, spaces, strict=True):
                logged = self._trials[i]
                columns = (logged.time, logged.motor, logged.regulator, self.interpolation)
                runs += [
                    Run(*columns, tables[i][k], states[i, k], zeros[i, k], FIRST_S, space[k])
                    for k in range(count)
                ]
            simulate_all(self.plant.program, runs, self.threads)
            if moved:
                each = zip(block, spaces, strict=True)
                spaces = [self._met(i, space, zeros[i], vectors) for i, space in each]
            results += work(block, spaces, zeros[block, : len(tried)], vectors)
        return results

    def _moved_starts(self) -> list[list[tuple[int, float]]]:
        """Parameters that say how trials begin, moved in one more simulation each, and by how much.

        A position whose zero is free begins anywhere.
        """
        if self._begun:
            free = self.plant.model.rig.signals[0].has_free_zero
            return [[(place, initial_states.MOVE)] for place, _ in self._begun[free:]]
        return [[(place, memory_start.MOVE) for place, _ in self._memories]] * bool(self._memories)

    def _met(self, number: int, space: Array, zeros: Array, vectors: Array) -> Array:
        """States of a trial that begins as fits best, shape (tried, rows, states).

        The last of those given are the first with another start; x0 moves with them.
        """
        if self._begun:
            return self._met_freely(space, zeros, vectors, self._trials[number])
        shares = self._start_shares(number, space, zeros, vectors)
        space[:-1] += shares[:, None, None] * (space[-1] - space[0])
        zeros[:-1] += shares * (zeros[-1] - zeros[0])
        return space[:-1]

    def _start_shares(self, number: int, space: Array, zeros: Array, vectors: Array) -> Array:
        """How many moves bring each simulation nearest to a trial's readings, shape (tried,)."""
        logged = self._trials[number]
        held = self._held(space, zeros, np.concatenate([vectors, vectors[:1]]))
        left = np.stack(held, axis=1) - logged.measured
        changes = self._in_noise(logged, left * logged.counts)
        along = changes[-1] - changes[0]
        return memory_start.best_shares(changes[:-1], along, self._reaches[number])

    def _in_noise(self, logged: Logged, left: Array) -> Array:
        """Differences (SI), (tried, signals, rows), in units of noise, (tried, numbers)."""
        return (left / self.deviations[:, None]).reshape(len(left), -1)

    def _met_freely(self, space: Array, zeros: Array, vectors: Array, logged: Logged) -> Array:
        """States of a free rig, begun as fits best; shape (tried, rows, states)."""
        tried, further = len(vectors), len(space) - len(vectors)
        every = np.concatenate([vectors, *([vectors[:1]] * further)])
        held = np.stack(self._held(space, zeros, every), axis=1)
        initial_states.meet(space, held, logged, self._levels, further)
        return space[:tried]

    @property
    def _levels(self) -> Array:
        """Standard deviations that signals are weighed by where a start is sought (SI)."""
        return self.deviations

    def _every(self, vectors: Array) -> Array:
        """Parameters of every trial at each of some, shape (trials * tried, numbers)."""
        every = np.tile(vectors, (len(self._trials), 1))
        for place, values in (*self._begun, *self._memories, *self._own):
            every[:, place] = np.repeat(values, len(vectors))
        return every

    def _tables(self, every: Array, count: int) -> list[list[Array]]:
        """Tables of every trial; the same ones where trials have no parameters of their own."""
        program = self.plant.program
        if not self._own:
            return [[table(program, vector) for vector in every[:count]]] * len(self._trials)
        parts = np.split(every, len(self._trials))
        return [[table(program, vector) for vector in part] for part in parts]

    def _indices(self, own: Mapping[str, Sequence[float]]) -> list[tuple[int, Array]]:
        """Where values (SI) go that a parameter has in each trial, by its path."""
        free = _free(self.plant.model, list(own))
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

    def _differences(
        self, logged: Logged, states: Array, zeros: Array, vectors: Array, central: bool
    ) -> Array:
        """Simulated minus measured, then what moving each parameter changes (SI).

        Shape (1 + p, signals, rows).
        """
        held = self._held(states, zeros, vectors)
        count, rows = len(states), len(logged.time)
        moved = (count - 1) // 2 if central else count - 1
        differences = np.zeros((1 + moved, len(self.plant.outputs), rows))
        for channel, signal in enumerate(held):
            if not logged.measures[channel]:
                continue
            there = differences[:, channel]
            np.subtract(signal[0], logged.measured[channel], out=there[0])
            if central:
                np.subtract(signal[1 : 1 + moved], signal[1 + moved :], out=there[1:])
                there[1:] *= 0.5
            else:
                np.subtract(signal[1:], signal[0], out=there[1:])
            if logged.missing[channel].size:
                there[:, logged.missing[channel]] = 0.0
        return differences

    def _held(self, states: Array, zeros: Array, vectors: Array) -> list[Array]:
        """What the sensors hold, shape (tried, rows) each."""
        columns, program = self.plant.sensor_columns, self.plant.program
        count, rows, _ = states.shape
        truth = np.empty((count, rows, len(self.plant.outputs)) if min(columns) < 0 else (0, 0, 0))
        for i, out in enumerate(truth):
            addresses = (vectors[i].ctypes.data, out.ctypes.data)
            program.observe(rows, states[i].ctypes.data, float(zeros[i]), *addresses)
        return [states[:, :, at] if at >= 0 else truth[:, :, i] for i, at in enumerate(columns)]

    def _multiplied(
        self,
        block: list[int],
        spaces: list[Array],
        zeros: Array,
        vectors: Array,
        central: bool,
    ) -> list[Array]:
        """Products of all differences with each other, in units of noise, (1 + p, 1 + p) each."""
        trials = []
        for number, states, zero in zip(block, spaces, zeros, strict=True):
            logged, weights = self._trials[number], self._weights[number]
            channels = [i for i, known in enumerate(logged.measures) if known]
            held = self._held(states, zero, vectors)
            trials.append(
                Signals(
                    [held[i] for i in channels],
                    [logged.measured[i] for i in channels],
                    [weights[i] for i in channels],
                    central,
                )
            )
        return products(trials, self.threads)


def _moved(values: Array, steps: Array, central: bool) -> Array:
    """The parameters, then with each of them moved, shape (tried, p)."""
    moves = np.diag(steps) if steps.size else np.empty((0, len(values)))
    both = [np.zeros((1, len(values))), moves, -moves]
    return values + np.concatenate(both if central else both[:2])


def _free(model: Model, paths: Sequence[str]) -> list[Free]:
    names, parameters = parameter_names(model), []
    # Its message names the nearest that there is.
    model.replace({path: 0.0 for path in paths if path not in set(model.paths())})
    for path in paths:
        effect, _, door = path.partition(".")
        law = model.effects[effect]
        stem = law.names_at_the_door()[door]
        if stem in law.rows or (effect in sensors.SENSORS and stem == "noise"):
            raise ModelError(
                f"{path} cannot be fitted: it is "
                + ("a row of numbers" if stem in law.rows else "what residuals are counted in")
            )
        parameters.append(Free(path, 1 + names.index(f"{effect}.{stem}"), law.quantities[stem]))
    return parameters
