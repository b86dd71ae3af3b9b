"""Experiments that a rig survives: what a lab can run next, as commands.

An excitation is a shape: of the load at constant pressure, of the pressure at constant load, or of
both, in turn or at once. Its size is the largest at which tension, contraction, stretch and
pressure stay within the model's limits with margin, in every model that may be true.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.thresholds import LEAST_LOAD_N, LIMIT_SHARE, MOST_VOLTS
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant

Array = NDArray[np.float64]
Shares = TypeVar("Shares", float, Array)
Knots = Sequence[tuple[float, float]]

RATE_HZ = 128.0
"""Commands a second; what a lab's DAQ can do, and fine enough that a step is a step."""

SIZES = (1.0, 0.85, 0.7, 0.55, 0.4)
"""Shares of the full range that are tried until an excitation is safe."""

PRESSURES = (0.12, 0.5, 0.88)
"""Constant pressures of excitations that change the load, as shares of the range of pressures."""

LOADS = (0.15, 0.4, 0.7)
"""Constant loads of excitations that change the pressure, as shares of the range of loads."""

LOW = 0.12
"""Share of the range of loads that a sudden step begins from: from less the cable would go slack
when the load comes back."""

PRESSURE_STEP = 0.25
"""Half the height of a step of pressure, as a share of the range of pressures."""


@dataclass(frozen=True)
class Excitation:
    """An experiment that is safe.

    Attributes:
        name: its name and settings in words.
        trial: time and commands, which begin settled.
        simulated: the same with readings (no noise) and truth, by each model that may be true.
    """

    name: str
    trial: Trial
    simulated: tuple[Trial, ...]

    @property
    def minutes(self) -> float:
        """How long it takes."""
        return self.trial.duration / 60.0


@dataclass(frozen=True)
class Range:
    """What a rig is asked for.

    Attributes:
        loads: lowest and highest load (N).
        pressures: lowest and highest pressure (Pa).
    """

    loads: tuple[float, float]
    pressures: tuple[float, float]

    @classmethod
    def of(cls, model: Model) -> "Range":
        """Of a model: what its drive and its regulator reach, less margins."""
        drive, limits = model.parameters["drive"], model.parameters["limits"]
        line, valid = model.parameters["regulator_line"], model.parameters["validity"]
        least, most = (drive.gain * volts + drive.offset for volts in (0.0, MOST_VOLTS))
        low, high = (line.gain * volts + line.offset for volts in (0.0, MOST_VOLTS))
        return cls(
            (max(LEAST_LOAD_N, least), min(most, LIMIT_SHARE * limits.tension)),
            (max(valid.lowest, low), min(valid.highest, LIMIT_SHARE * limits.pressure, high)),
        )

    def pressure(self, share: Shares) -> Shares:
        """Pressures (Pa) from shares of the range."""
        low, high = self.pressures
        return low + share * (high - low)

    def load(self, share: Shares, size: float) -> Shares:
        """Loads (N) from shares of the range, whose top is lowered to a size."""
        low, high = self.loads
        return low + share * size * (high - low)


Recipe = Callable[[float], tuple[str, Trial]]
"""Name and commands of an excitation of some size, a share of the full range."""


def library(models: Sequence[Model], seed: int = 0) -> Iterator[Excitation]:
    """All excitations that are safe, one after the other.

    None for what is no station: only a station comes to rest by itself.

    Args:
        models: those that may be true; the first one's lines give the volts.
        seed: of the phases of multisines.
    """
    if not models[0].rig.balances_loads:
        # A rig that nothing holds runs away from commands that nobody corrects, and where a motion
        # is imposed the safe motions are the drive's.
        return
    plants = [Plant(model) for model in models]
    for recipe in _recipes(models[0], seed):
        largest = _largest(plants, recipe)
        if largest is not None:
            yield largest


def _largest(plants: Sequence[Plant], recipe: Recipe) -> Excitation | None:
    """An excitation as large as is safe in every model; None if it never is."""
    for size in SIZES:
        name, trial = recipe(size)
        try:
            simulated = [plant.simulate(trial, noise=False) for plant in plants]
        except ValueError:
            # Some model has no rest at these commands: smaller ones may do.
            continue
        pairs = zip(plants, simulated, strict=True)
        if all(is_safe(plant.model, run) for plant, run in pairs):
            return Excitation(name, trial, tuple(simulated))
    return None


def is_safe(model: Model, simulated: Trial) -> bool:
    """Whether a simulated trial keeps the model's limits with margin."""
    limits, truth = model.parameters["limits"], simulated.truth
    contraction = truth["contraction"]
    kept = (
        (np.max(contraction), limits.contraction),
        (-np.min(contraction), limits.stretch),
        (np.max(truth["load"]), limits.tension),
        (np.max(truth["pressure"]), limits.pressure),
    )
    # A number that is none keeps no limit.
    return all(reached <= LIMIT_SHARE * limit for reached, limit in kept)


def _recipes(model: Model, seed: int) -> Iterator[Recipe]:
    for words, share in _load_shapes(seed):
        for pressure in PRESSURES:
            yield partial(_of_load, model, words, share, pressure)
    for words, knots, centres in _pressure_shapes():
        for load, centre in centres:
            yield partial(_of_pressure, model, words, knots, centre, load)
    for words, load_share, pressure_share in _both_shapes(seed):
        yield partial(_of_both, model, words, load_share, pressure_share)


def _of_load(
    model: Model, words: str, share: Array, pressure: float, size: float
) -> tuple[str, Trial]:
    """Load changes, between shares 0 and 1 of its range; the pressure stands at a share of its."""
    span = Range.of(model)
    loads, held = span.load(share, size), span.pressure(pressure)
    low, high = np.min(loads), np.max(loads)
    name = f"{words}, {low:.0f} to {high:.0f} N at {held / 1e3:.0f} kPa"
    return name, _trial(model, loads, np.full(len(loads), held))


def _of_pressure(
    model: Model, words: str, knots: Knots, centre: float, load: float, size: float
) -> tuple[str, Trial]:
    """Pressure changes about a share of its range; the load stands at a share of its."""
    span, held = Range.of(model), Range.of(model).load(load, size)
    pressures = span.pressure(np.clip(centre + _interpolated(knots), 0.0, 1.0))
    low, high = np.min(pressures) / 1e3, np.max(pressures) / 1e3
    name = f"{words}, {low:.0f} to {high:.0f} kPa at {held:.0f} N"
    return name, _trial(model, np.full(len(pressures), held), pressures)


def _of_both(
    model: Model, words: str, load: Array, pressure: Array, size: float
) -> tuple[str, Trial]:
    """Load and pressure change, between shares 0 and 1 of their ranges."""
    span = Range.of(model)
    loads, pressures = span.load(load, size), span.pressure(pressure)
    name = (
        f"{words}, {np.min(loads):.0f} to {np.max(loads):.0f} N and "
        f"{np.min(pressures) / 1e3:.0f} to {np.max(pressures) / 1e3:.0f} kPa"
    )
    return name, _trial(model, loads, pressures)


def _trial(model: Model, loads: Array, pressures: Array) -> Trial:
    """Loads (N) and pressures (Pa) as volts, which any lab's log has."""
    drive, line = model.parameters["drive"], model.parameters["regulator_line"]
    commands = {
        "motor_voltage": np.clip((loads - drive.offset) / drive.gain, 0.0, 10.0),
        "regulator_voltage": np.clip((pressures - line.offset) / line.gain, 0.0, 10.0),
    }
    return Trial(np.arange(len(loads)) / RATE_HZ, commands)


def _load_shapes(seed: int) -> Iterator[tuple[str, Array]]:
    """Shapes of the load: words, and shares of its range."""
    yield (
        "slow load triangle, once in 20 s",
        _interpolated([(0, 0), (1, 0), (11, 1), (21, 0), (22, 0)]),
    )
    peaks = [(1 + 0.5 * k, k % 2) for k in range(17)]
    yield "fast load triangle, 8 times in 8 s", _interpolated([(0, 0), *peaks, (10, 0)])
    yield "load step, held for 5 s, and back", _steps([(1, LOW), (5, 1), (5, LOW)])
    yield "reversal staircase, growing amplitudes in 15 s", _interpolated(_staircase())
    yield "multisine of load, 0.2 to 5 Hz in 12 s", _multisine(seed)
    swaps = [(0.8, 0.15 if k % 2 else 0.85) for k in range(10)]
    yield "load swaps every 0.8 s", _steps([(1, 0.15), *swaps, (1, 0.15)])
    yield "load step, held for 20 s, and back", _steps([(2, LOW), (20, 1), (10, LOW)])


def _pressure_shapes() -> Iterator[tuple[str, Knots, list[tuple[float, float]]]]:
    """Shapes of the pressure: words, knots, and pairs of load and centre, as shares."""
    high, low = PRESSURE_STEP, -PRESSURE_STEP
    times = np.cumsum([1.0, *[2.5] * 4])
    steps: list[tuple[float, float]] = [(0.0, 0.0)]
    for start, before, after in zip(times, (0, high, 0, low), (high, 0, low, 0), strict=False):
        steps += [(float(start), before), (float(start) + 1.0 / RATE_HZ, after)]
    steps.append((float(times[-1]) + 1.0, 0.0))
    levels = [(LOADS[1], max(centre, high)) for centre in (0.25, 0.5, 0.75)]
    yield "pressure steps, held for 2.5 s", steps, levels
    triangle = [(0.0, 0.0), (1.0, 0.0), (9.0, 1.0), (17.0, 0.0), (18.0, 0.0)]
    yield "pressure triangle, once in 16 s", triangle, [(load, 0.0) for load in LOADS]


def _both_shapes(seed: int) -> Iterator[tuple[str, Array, Array]]:
    """Shapes of both: words, shares of the range of loads, shares of that of pressures.

    Who does not know what is missing wants one experiment that hides little: each change of load
    and of pressure that the other excitations have, in one trial.
    """
    slow = _interpolated([(0, 0.05), (1, 0.05), (5, 0.95), (9, 0.05)])
    fast = _interpolated([(0, LOW), *[(1 + k, LOW + 0.7 * (k % 2)) for k in range(9)]])
    swaps = _steps([(1, 0.15), *[(0.8, 0.8 if k % 2 == 0 else 0.15) for k in range(5)]])
    hold = _steps([(4, 0.8), (2, 0.2)])
    # Large ones and small ones, for limits of speed and for dead bands.
    steps = _steps([(1, 0.5), (2, 0.95), (2, 0.05), (2, 0.5), (1, 0.55), (1, 0.5)])
    still = np.full(len(swaps) + len(hold), 0.5)
    # From where the triangle ends to where the pressure stands.
    rise = _interpolated([(0, 0.05), (1, 0.5), (2, 0.5)])
    yield (
        "load triangles on one of pressure, load swaps, a hold, then steps of pressure",
        np.concatenate([fast, np.full(len(rise), LOW), swaps, hold, np.full(len(steps), LOADS[1])]),
        np.concatenate([slow, rise, still, steps]),
    )
    wave = _multisine(seed)
    steps = _steps([(2, 0.5), (2, 0.9), (2, 0.1), (2, 0.5), (2, 0.55), (2, 0.5)])
    yield "multisine of load during steps of pressure", 0.1 + 0.75 * wave, _held(steps, len(wave))
    slow = _interpolated([(0, 0.05), (1, 0.05), (9, 0.95), (17, 0.05), (18, 0.05)])
    fast = _interpolated([(0, LOW), *[(1 + k, LOW + 0.7 * (k % 2)) for k in range(17)], (18, LOW)])
    yield "load triangles, 8 in 16 s, during one of pressure", fast, slow


def _held(values: Array, count: int) -> Array:
    """So many rows of a shape, its last value held."""
    return values[np.minimum(np.arange(count), len(values) - 1)]


def _staircase() -> Knots:
    """Turns at 0.6, 0.4, 0.7, 0.3, ... of the range, at one rate, so that only amplitude grows."""
    turns = [0.5]
    for k in range(1, 6):
        turns += [0.5 + 0.1 * k, 0.5 - 0.1 * k]
    turns.append(0.5)
    times = 1.0 + np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turns)))]) / 0.4
    return [(0.0, 0.5), *zip(times.tolist(), turns, strict=True), (float(times[-1]) + 1.0, 0.5)]


def _multisine(seed: int) -> Array:
    """Five tones of falling amplitude, which begin and end gently."""
    time = np.arange(round(12.0 * RATE_HZ) + 1) / RATE_HZ
    phases = np.random.Generator(np.random.Philox(seed)).uniform(0.0, 2.0 * np.pi, 5)
    tones = zip((0.2, 0.5, 1.1, 2.3, 5.0), (1.0, 0.8, 0.6, 0.4, 0.3), phases, strict=True)
    wave = np.sum([size * np.sin(2 * np.pi * f * time + at) for f, size, at in tones], axis=0)
    gently = np.clip(np.minimum(time - 0.5, time[-1] - 0.5 - time), 0.0, 1.0)
    return 0.5 + 0.5 * gently * wave / np.max(np.abs(wave))


def _steps(levels: Knots) -> Array:
    """Levels that are held so long (s) each; a step takes one row."""
    knots, start = [], 0.0
    for held, level in levels:
        knots += [(start + 1.0 / RATE_HZ if start else 0.0, level), (start + held, level)]
        start += held
    return _interpolated(knots)


def _interpolated(knots: Knots) -> Array:
    """Knots of time (s) and value, joined linearly, at every row."""
    times, values = np.array(knots, float).T
    return np.interp(np.arange(round(times[-1] * RATE_HZ) + 1) / RATE_HZ, times, values)
