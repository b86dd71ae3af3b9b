"""Innovations of logged trials by a model with a latent force, at many points at once."""

import ctypes
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass
from functools import cache, cached_property
from math import hypot
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.graph import FIXED
from pma_gym.codegen.machine.control import Module
from pma_gym.codegen.machine.native import compiled, simd_lanes
from pma_gym.effects.effect import Effect
from pma_gym.effects.ports import MOUNT, SENSOR_DELAY
from pma_gym.effects.slide.coulomb_friction import friction_path
from pma_gym.estimation.logged import Logged
from pma_gym.estimation.turns import turning
from pma_gym.integrator.filter_kernel import FilterEquations, parameter_slots, write_filter
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.model import Model
from pma_gym.plant.program import parameter_names, structure
from pma_gym.plant.sensors import mount_error
from pma_gym.units import Quantity

Array = NDArray[np.float64]

LATENT, COLOUR = "latent_force", "colour"

PORTS = {"slide": "slide_force", "joint": "joint_torque"}
"""Where the latent force acts, by rig: drive and load act on one mass, so they are one place."""

SPEEDS = {"slide": "velocity", "joint": "spin"}
"""The state that is the speed, by rig."""

TREND, TRIAL = "~", "@"
"""Marks of a parameter's further numbers.

`slot~` is its change from trial to trial, `slot@2` its value in trial 2.
"""

FIRST_ROWS, FIRST_BLOCKS = 8, 80
"""Readings that a first speed is taken from, and blocks of rows among which they are looked for."""


class LatentForce(NamedTuple):
    """Parameters of the latent force."""

    memory_time: Annotated[float, Quantity("s", 1e-4, 1e3, "assumption: 0.05", usual=0.05)]


def _force(memory):  # noqa: ANN001, ANN202
    return memory


def _decay(p):  # noqa: ANN001, ANN202
    return 0.0, 1.0 / p.memory_time


@dataclass(frozen=True)
class Kernel:
    """The compiled filter of one structure.

    Attributes:
        call: the compiled function, see `filter_kernel.ARGUMENTS`.
        slots: names of the parameters that it takes.
        states: names of its states.
        width: lanes.
    """

    call: Callable
    slots: tuple[str, ...]
    states: tuple[str, ...]
    width: int

    @property
    def size(self) -> int:
        """Numbers of a mean and a covariance."""
        n = len(self.states)
        return n + n * (n + 1) // 2


def equations(model: Model, channels: Sequence[int], coloured: bool = False) -> FilterEquations:
    """The filter's arithmetic for a model and the signals that are read.

    Whether the first of them has coloured noise too: one with a memory, drift if that is long.
    """
    latent = Effect(LATENT, PORTS[model.plant], LatentForce, law=_force, rate=_decay)
    eq = PlantEquations(
        {**model.effects, LATENT: latent}, {**model.parameters, LATENT: LatentForce(1.0)}, "zoh"
    )
    model.rig.write_equations(eq)
    noisy = {f"memory_{LATENT}": "process_noise"}
    readings = [eq.readings[model.rig.signals[channel].name] for channel in channels]
    if coloured:
        noisy[COLOUR] = f"{COLOUR}_noise"
        eq.add_state(COLOUR, -eq[COLOUR] / eq.graph.input(f"{COLOUR}_memory", FIXED), None)
        readings[0] = readings[0] + eq[COLOUR]
    eq.finish()
    bristles = [
        n
        for e in model.effects.values()
        if e.rate_independent_law is friction_path
        for n in e.memory_names
    ]
    return FilterEquations(eq, noisy, readings, bristles)


_kernels: dict[tuple[str, ...], Kernel] = {}


def kernel(
    model: Model, channels: Sequence[int], coloured: bool = False, keeps: bool = False
) -> Kernel:
    """The compiled filter of a model's structure; of `keeps`, for a smoother, with one lane."""
    width = 1 if keeps else simd_lanes()
    how = (*channels, width, keeps, *([COLOUR] if coloured else []))
    key = ("grey box", *structure(model), *map(str, how))
    if key not in _kernels:
        made = equations(model, channels, coloured)

        def build() -> Module:
            module = Module()
            write_filter(module, made, width, keeps)
            return module

        library = compiled(key, build, f"filter of {model.name}", brief=True)
        call = library.function("innovations", [ctypes.c_int64] + [ctypes.c_void_p] * 8)
        states = tuple(state.name for state in made.states)
        _kernels[key] = Kernel(call, tuple(parameter_slots(made, keeps)), states, width)
    return _kernels[key]


@dataclass(frozen=True)
class Point:
    """Values that a filter runs with.

    Attributes:
        numbers: the model's parameters (SI) by slot, with those of single trials and trends.
        deviations: standard deviation of each read signal's noise (SI).
        forces: standard deviation of the latent force in each trial (N, N m).
        memory: how long it remembers (s).
        delay: of the command (s).
        clock: share by which the readings' clock runs fast beside that of the commands.
        colour: standard deviation of the first read signal's coloured noise (SI); 0 for none.
        colour_memory: how long that remembers (s).
    """

    numbers: Mapping[str, float]
    deviations: tuple[float, ...]
    forces: tuple[float, ...]
    memory: float
    delay: float = 0.0
    clock: float = 0.0
    colour: float = 0.0
    colour_memory: float = 1.0

    @property
    def noises(self) -> tuple[float, ...]:
        """Standard deviation of each read signal's noise, white and coloured (SI)."""
        return hypot(self.deviations[0], self.colour), *self.deviations[1:]

    @property
    def pace(self) -> float:
        """Time of the commands in one second of the readings' clock (s)."""
        return 1.0 / (1.0 + self.clock)


class Rows:
    """One trial as the filter reads it.

    Blocks of rows as one reading each, commands as means over steps.

    Args:
        logged: the trial.
        channels: signals that are read.
        steps: integration steps between two blocks.
        linear: whether commands are linear between rows instead of held.
        block: rows of a block.
        stride: of so many blocks one is read.
        coarse: for each signal, whether its steps are coarser than its noise. A dwell in one step
            counts as two readings then, the first and the last: those between tell nothing new, and
            hundreds of them would outweigh all that moves.
        extrapolated: whether a filter runs with twice the steps too, and what comes out is
            extrapolated to none.
        noise: of each signal's readings, where steps in which the motion may turn are divided into
            `TURNS` each.
    """

    def __init__(
        self,
        logged: Logged,
        channels: Sequence[int],
        steps: int,
        linear: bool,
        block: int,
        stride: int = 1,
        coarse: Sequence[bool] = (),
        extrapolated: bool = False,
        noise: Sequence[float] = (),
    ) -> None:
        self.steps = steps
        starts = np.arange(0, len(logged.time), block)
        self.sizes = np.diff(np.append(starts, len(logged.time)))
        self.time = np.add.reduceat(np.asarray(logged.time, float), starts) / self.sizes
        self.readings = np.zeros((len(starts), len(channels), 2))
        for i, channel in enumerate(channels):
            counts = np.add.reduceat(logged.counts[channel], starts)
            total = np.add.reduceat(logged.measured[channel] * logged.counts[channel], starts)
            self.readings[:, i, 0] = total / np.maximum(counts, 1.0)
            self.readings[:, i, 1] = counts == self.sizes
        self._opening = self.time[:FIRST_BLOCKS], self.readings[:FIRST_BLOCKS].copy()
        apart = np.asarray(logged.time, float) - np.repeat(self.time, self.sizes)
        spread = np.add.reduceat(apart**2, starts) / self.sizes
        shifts = _mean_shifts(self.readings, self.time, spread)[::stride]
        self.time, self.readings = (
            self.time[::stride],
            np.ascontiguousarray(self.readings[::stride]),
        )
        self.measured = self.readings[:, :, 1] > 0
        for i in np.flatnonzero(coarse):
            dwells = np.diff(self.readings[:, i, 0]) == 0.0
            self.readings[1:-1, i, 1] *= ~(dwells[1:] & dwells[:-1])
        self.there = self.readings[:, :, 1] > 0
        self.readings[:, :, 0] -= shifts
        self._motor, self._at = np.asarray(logged.motor, float), np.asarray(logged.time, float)
        between = np.diff(self._at)
        rise = np.diff(self._motor) / between if linear else np.zeros(len(between))
        self._slopes = rise if linear else None
        held = self._motor[:-1] * between + 0.5 * rise * between**2
        self._sums = np.concatenate([[0.0], np.cumsum(held)])
        self._starts: dict[tuple[int | None, int | None], tuple[float, float, float]] = {}
        shares = np.arange(steps) / steps
        spans = np.diff(self.time)[:, None]
        edges = np.append(self.time[:-1, None] + spans * shares, self.time[-1])
        counts = np.ones(len(edges) - 1, int)
        if len(noise):
            shown = np.where(logged.counts[channels[0]] > 0, logged.measured[channels[0]], np.nan)
            turns = turning(self._at, shown, noise[0] * block**0.5, channels[0] > 0) * between
            passed = np.interp(edges, self._at, np.concatenate([[0.0], np.cumsum(turns)]))
            counts[np.diff(passed) > 0.0] = TURNS
        per_row = counts.reshape(-1, steps).sum(axis=1)
        self._stepped(np.concatenate([[0, 0], np.cumsum(per_row)]), divided(edges, counts))
        self.finer: Rows | None = None
        if extrapolated:
            finer = copy(self)
            finer._stepped(2 * self.firsts, divided(self._edges, np.full(len(self.lengths), 2)))
            self.finer = finer

    def _stepped(self, firsts: NDArray[np.int64], edges: Array) -> None:
        """Take steps: numbers of the first that lead to each row, and the times between them."""
        self.firsts, self._edges, self.lengths = firsts, edges, np.diff(edges)
        self._known: dict[tuple[float, float], Array] = {}

    @property
    def first(self) -> float:
        """Command in the first row."""
        return float(self._motor[0])

    def commands(self, delay: float, pace: float = 1.0) -> Array:
        """Mean command over each step, shape (steps of all rows,).

        Late by a delay (s), and by what a clock of another pace has gained since the first row.
        """
        known = self._known.get((delay, pace))
        if known is None:
            known = self._means(self._edges, delay, pace)
            if len(self._known) > MOST_KEPT:
                self._known.clear()
            self._known[delay, pace] = known
        return known

    def mean_commands(self, delay: float, pace: float = 1.0) -> Array:
        """The same between each row and the one before it, shape (rows,)."""
        return np.append(self.first, self._means(self.time, delay, pace))

    def _means(self, edges: Array, delay: float, pace: float) -> Array:
        at = self._at[0] + pace * (edges - self._at[0]) - delay
        return np.diff(self._integral(at)) / np.diff(at)

    def _integral(self, at: Array) -> Array:
        """Integral of the command up to given times; before the first row it is as there."""
        early = self.first * np.minimum(at - self._at[0], 0.0)
        if self._slopes is None:
            return early + np.interp(at, self._at, self._sums)
        rows = np.interp(at, self._at, np.arange(len(self._at)))
        place = np.minimum(rows.astype(int), len(self._slopes) - 1)
        beyond = np.maximum(at - self._at[place], 0.0)
        rest = (self._motor[place] + 0.5 * self._slopes[place] * beyond) * beyond
        return early + self._sums[place] + rest

    def begin(self, position: int | None, speed: int | None) -> tuple[float, float, float]:
        """First position and speed, with the speed's standard deviation, from the first rows."""
        if (position, speed) not in self._starts:
            self._starts[position, speed] = self._first(position, speed)
        return self._starts[position, speed]

    def _first(self, position: int | None, speed: int | None) -> tuple[float, float, float]:
        first, motion, spread = 0.0, 0.0, 0.0
        time, readings = self._opening
        if position is not None:
            there = np.flatnonzero(readings[:, position, 1])[:FIRST_ROWS]
            y, t = readings[there, position, 0], time[there]
            first, motion = float(y[0]), float(np.polyfit(t - t[0], y, 1)[0])
            spread = (float(np.ptp(y)) + 1e-12) / (t[-1] - t[0])
        if speed is not None:
            there = np.flatnonzero(readings[:, speed, 1])[:FIRST_ROWS]
            y = readings[there, speed, 0]
            motion, spread = float(y[0]), float(np.std(y)) + 1e-12
        return first, motion, spread


TURNS = 2
"""Steps that a step is divided into in which the motion may turn."""


def _mean_shifts(readings: Array, time: Array, spread: Array) -> Array:
    """What the curvature of the motion shifts each block's mean by, shape (rows, signals).

    Half of the second derivative times the mean square of the times about their mean. Two blocks
    before and behind tell it; at the ends, and where a reading is missing, none is known.

    Args:
        readings: means of blocks, and whether each is known, shape (rows, signals, 2).
        time: means of the blocks' times (s), shape (rows,).
        spread: mean squares of the times about them (s^2), shape (rows,).
    """
    means, read = readings[:, :, 0], readings[:, :, 1] > 0
    shifts = np.zeros_like(means)
    known = read[4:] & read[2:-2] & read[:-4]
    slopes = (means[2:] - means[:-2]) / (time[2:] - time[:-2])[:, None]
    second = 2.0 * (slopes[2:] - slopes[:-2]) / (time[4:] - time[:-4])[:, None]
    shifts[2:-2] = 0.5 * spread[2:-2, None] * second * known
    return shifts


def divided(edges: Array, counts: NDArray[np.int64]) -> Array:
    """Edges of steps (s) of which each is divided evenly into so many."""
    into = np.repeat(np.arange(len(counts)), counts)
    shares = (np.arange(len(into)) - np.cumsum(counts)[into] + counts[into]) / counts[into]
    return np.append(edges[into] + np.diff(edges)[into] * shares, edges[-1])


MOST_KEPT = 32
"""Delays whose commands are kept."""


@dataclass(frozen=True)
class Kept:
    """What a smoother needs of one trial.

    Means (rows, n), covariances and transitions (rows, n, n).
    """

    states: tuple[str, ...]
    predicted: Array
    spread: Array
    corrected: Array
    certain: Array
    transition: Array


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Threads of this process: those of its parent do not come with it."""
    return ThreadPoolExecutor(threads)


class GreyBox:
    """A model's filter over trials.

    Args:
        model: the model.
        rows: the trials.
        channels: signals that are read.
        threads: that run at once, over trials and parameter vectors; the bits are the same.
    """

    def __init__(
        self,
        model: Model,
        rows: Sequence[Rows],
        channels: Sequence[int],
        threads: int = 1,
    ) -> None:
        self.threads = threads
        self.model, self.rows, self.channels = model, list(rows), tuple(channels)
        self.order: Array = np.arange(float(len(rows))) - 0.5 * (len(rows) - 1)

    def numbers(self) -> dict[str, float]:
        """The model's own parameters (SI) by slot."""
        return dict(zip(parameter_names(self.model), self.model.vector().tolist(), strict=True))

    def innovations(
        self, points: Sequence[Point], rows: Sequence[Rows] | None = None
    ) -> list[tuple[Array, Array]]:
        """Innovations and their variances of each trial, shape (points, rows, signals) each."""
        k = kernel(self.model, self.channels, any(point.colour for point in points))
        width, trials = k.width, list(rows or self.rows)
        results = [
            (np.empty(shape), np.empty(shape))
            for shape in [(len(points), len(t.time), len(self.channels)) for t in trials]
        ]

        def part(number: int, first: int) -> None:
            some = list(points[first : first + width])
            filled = some + [some[-1]] * (width - len(some))
            trial = trials[number]
            arguments = self._arguments(k, number, trial, filled)
            out = self._run(k, trial, filled, arguments)
            if trial.finer is not None:
                out = _extrapolated(out, self._run(k, trial.finer, filled, arguments))
            for i, into in enumerate(results[number]):
                into[first : first + width] = np.moveaxis(out[:, :, i, : len(some)], -1, 0)

        parts = [(n, first) for n in range(len(trials)) for first in range(0, len(points), width)]
        work = _pool(self.threads, os.getpid()).map if self.threads > 1 else map
        list(work(part, *zip(*parts, strict=True)))
        return results

    def kept(self, number: int, point: Point) -> Kept:
        """Means, covariances and transitions of one trial."""
        k = kernel(self.model, self.channels, bool(point.colour), keeps=True)
        n, s, trial = len(k.states), k.size, self.rows[number].finer or self.rows[number]
        room = np.empty((len(trial.time), 2 * s + n * n))
        self._run(k, trial, [point], self._arguments(k, number, trial, [point]), room)
        lower = np.tril_indices(n)

        def full(flat: Array) -> Array:
            out = np.zeros((len(flat), n, n))
            out[:, lower[0], lower[1]] = out[:, lower[1], lower[0]] = flat
            return out

        transition = room[:, 2 * s :].reshape(-1, n, n)
        return Kept(
            k.states,
            room[:, :n],
            full(room[:, n:s]),
            room[:, s : s + n],
            full(room[:, s + n : 2 * s]),
            transition,
        )

    def _arguments(
        self, k: Kernel, number: int, trial: Rows, points: Sequence[Point]
    ) -> tuple[Array, Array]:
        """Parameters (slots, points), and means and covariances at the first row, of a trial."""
        parameters = [self._vector(point, k.slots, number) for point in points]
        starts = [self._start(trial, point, number, k.states) for point in points]
        return np.array(parameters).T.copy(), np.array(starts).T.copy()

    def _run(
        self,
        k: Kernel,
        trial: Rows,
        points: Sequence[Point],
        arguments: tuple[Array, Array],
        kept: Array | None = None,
    ) -> Array:
        commands = np.array([trial.commands(p.delay, p.pace) for p in points]).T
        out = np.empty((len(trial.time), len(self.channels), 2, len(points)))
        arrays = [
            np.ascontiguousarray(a)
            for a in (trial.firsts, trial.lengths, commands, trial.readings, *arguments)
        ]
        addresses = [a.ctypes.data for a in (*arrays, out)]
        k.call(len(trial.time), *addresses, 0 if kept is None else kept.ctypes.data)
        return out

    def _vector(self, point: Point, slots: Sequence[str], number: int) -> Array:
        own = {
            f"{LATENT}.memory_time": point.memory,
            "process_noise": 2.0 * point.forces[number] ** 2 / point.memory,
            f"{COLOUR}_noise": 2.0 * point.colour**2 / point.colour_memory,
            f"{COLOUR}_memory": point.colour_memory,
            "pace": point.pace,
        }
        own |= {f"variance {i}": value**2 for i, value in enumerate(point.deviations)}
        if not any(TRIAL in name or TREND in name for name in point.numbers):
            own = {**point.numbers, **own}
        return np.array(
            [own[s] if s in own else value_in_trial(point, s, number, self.order) for s in slots]
        )

    @cached_property
    def _late(self) -> list[str]:
        """Effects that make the position's reading late."""
        port = f"{SENSOR_DELAY}{self.model.rig.signals[0].name}"
        return [e.name for e in self.model.effects.values() if e.port == port]

    @cached_property
    def _begins_as(self) -> dict[str, str]:
        """What each state is at a trial's first row."""
        signals = self.model.rig.signals
        position, speed = (signal.name for signal in signals[:2])
        into = {
            "drive_delay": "asked",
            "drive_lag": "asked",
            f"{SENSOR_DELAY}{position}": "position",
            f"{SENSOR_DELAY}{speed}": "speed",
        }
        tags = {
            position: "position",
            SPEEDS[self.model.plant]: "speed",
            f"memory_{LATENT}": "force",
            COLOUR: "colour",
            f"lag_{signals[0].sensor}": "position",
            f"lag_{signals[1].sensor}": "speed",
        }
        for effect in self.model.effects.values():
            for number, name in enumerate(effect.memory_names, 1):
                # At rest the even states of a delay's ladder are what goes into it, the odd ones 0.
                passed = effect.port in into and (effect.memories == 1 or number % 2 == 0)
                odd = "way" if effect.name in self._late else "nothing"
                other = "bristle" if effect.rate_independent_law else odd
                tags[name] = into[effect.port] if passed else other
        return tags

    def _start(self, trial: Rows, point: Point, number: int, states: Sequence[str]) -> Array:
        """Mean and covariance at a trial's first row."""
        where = {channel: i for i, channel in enumerate(self.channels)}
        first, motion, spread = trial.begin(where.get(0), where.get(1))
        level = 2.0 * point.deviations[where[0]] if 0 in where else 0.0
        # A late reading in motion is not where the rig is, and its ladder is not at rest.
        way = abs(motion) * sum(point.numbers[f"{name}.delay"] for name in self._late)
        level = hypot(level, way, self._mounted(point, first))
        pairs = {
            "position": (first, level),
            "speed": (motion, spread),
            "force": (0.0, point.forces[number]),
            "colour": (0.0, point.colour),
            "asked": (self.asked(trial.first), 0.0),
            "way": (0.0, way),
            "bristle": (0.0, BRISTLE),
            "nothing": (0.0, 0.0),
        }
        n = len(states)
        out = np.zeros(n + n * (n + 1) // 2)
        for i, name in enumerate(states):
            out[i], deviation = pairs[self._begins_as.get(name, "nothing")]
            out[n + i * (i + 3) // 2] = deviation**2
        return out

    def _mounted(self, point: Point, first: float) -> float:
        """What the mount of the position's sensor may add to a first reading."""
        position = self.model.rig.signals[0].name
        mounts = [e for e in self.model.effects.values() if e.port == f"{MOUNT}{position}"]
        if not mounts:
            return 0.0
        parameters = {
            e.name: e.parameters(*(point.numbers[f"{e.name}.{stem}"] for stem in e.quantities))
            for e in mounts
        }
        return float(mount_error(self.model, parameters, position, first, lambda _: 1.0))

    def asked(self, command: float) -> float:
        """What the drive asks for at a command (N; else the command itself)."""
        drive = self.model.effects.get("two_way_drive")
        if drive is None or drive.law is None:
            return command
        return float(drive.law(command, self.model.parameters[drive.name]))


BRISTLE = 3.0**-0.5
"""Standard deviation of a bristle's first deflection, which may be anything from -1 to 1."""


def counted(rows: Rows, counts: NDArray[np.bool_]) -> Rows:
    """The same trial with only some of its rows read; innovations are of all."""
    other = copy(rows)
    other.readings = rows.readings.copy()
    other.readings[:, :, 1] *= counts[:, None]
    other.finer = rows.finer and counted(rows.finer, counts)
    return other


def _extrapolated(coarse: Array, fine: Array) -> Array:
    """Innovations and variances in the limit of short steps, of a method of order 2 (Richardson).

    A variance by its logarithm, so that it stays above none.
    """
    with np.errstate(all="ignore"):
        errors = fine[:, :, 0] + (fine[:, :, 0] - coarse[:, :, 0]) / 3.0
        spreads = fine[:, :, 1] * np.cbrt(fine[:, :, 1] / coarse[:, :, 1])
    return np.stack([errors, spreads], axis=2)


def predictions(box: GreyBox, point: Point, horizon: float) -> list[Array]:
    """What a filter expects a horizon ahead, shape (rows, signals) each.

    Each window (s) from the readings of the one before; the first has none before it, and is NaN.
    """
    expected = []
    numbers = [((trial.time - trial.time[0]) / horizon).astype(int) for trial in box.rows]
    windows = [number % 2 == 0 for number in numbers]
    for odd in (False, True):
        rows = [
            counted(trial, (window != odd) | (number == 0))
            for trial, window, number in zip(box.rows, windows, numbers, strict=True)
        ]
        results = box.innovations([point], rows)
        expected.append(
            [
                t.readings[:, :, 0] - errors[0]
                for t, (errors, _) in zip(box.rows, results, strict=True)
            ]
        )
    return [
        np.where((number == 0)[:, None], np.nan, np.where(window[:, None], late, early))
        for number, window, early, late in zip(numbers, windows, *expected, strict=True)
    ]


def is_rugged(model: Model) -> bool:
    """Whether a model has dry friction, or another law of the way: its likelihood jumps."""
    return any(effect.rate_independent_law for effect in model.effects.values())


def value_in_trial(point: Point, slot: str, number: int, order: Array) -> float:
    """A parameter's value in one trial."""
    value = point.numbers.get(f"{slot}{TRIAL}{number}", point.numbers[slot])
    return value + point.numbers.get(f"{slot}{TREND}", 0.0) * order[number]


def log_likelihood(results: Sequence[tuple[Array, Array]], rows: Sequence[Rows]) -> Array:
    """Log likelihood of each point less a constant, shape (points,).

    Minus infinity where a filter fails.
    """
    total = np.zeros(len(results[0][0]))
    with np.errstate(all="ignore"):
        for (errors, spreads), trial in zip(results, rows, strict=True):
            total -= 0.5 * ((errors**2 / spreads + np.log(spreads)) * trial.there).sum(axis=(1, 2))
    return np.where(np.isfinite(total), total, -np.inf)
