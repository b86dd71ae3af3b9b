"""Random trials within what the rig bears: loads and pressures over time, by the lab's numbers."""

from collections.abc import Callable

import numpy as np

from benchmarks.hidden_effects.physics.rig import NOMINAL, Array
from benchmarks.hidden_effects.physics.simulation import RATE

Generator = np.random.Generator

LONGEST, DEEPEST = 54e-3, -3e-3
"""Contractions (m) that are asked for by the lab's numbers; the true ones differ by a tenth."""

START_S, HOLD_S = 0.5, 0.8
"""Constant commands at the beginning and at the end of a trial (s)."""


def loads_at(pressure: float, deepest: float = DEEPEST) -> tuple[float, float]:
    """Least and largest load (N) at a pressure (Pa)."""
    low = pressure <= 314e3
    at, slope = ("stiffness_low", "stiffness_low_slope") if low else (
        "stiffness_high", "stiffness_high_slope"
    )  # fmt: skip
    spring = NOMINAL[at] + NOMINAL[slope] * pressure
    force = NOMINAL["force_slope"] * pressure + NOMINAL["force_intercept"]
    return max(70.0, force - spring * LONGEST), min(900.0, force - spring * deepest)


def draw_trial(
    generator: Generator, name: str, seconds: float, loose: bool, deep: bool
) -> tuple[Array, Array]:
    """An excitation's motor and regulator voltages, shape (rows,) each.

    Args:
        generator: source of chance.
        name: of the excitation.
        seconds: how long.
        loose: begin without any load.
        deep: go beyond the resting length.
    """
    g, time = generator, np.arange(round(seconds * RATE)) / RATE
    pressure, load = EXCITATIONS[name](g, time, -7e-3 if deep else DEEPEST)
    if deep and np.ptp(load) > 0.0:
        load = np.maximum(load + loads_at(float(pressure.min()), -7e-3)[1] - load.max(), 70.0)
    if loose:
        # Only a pressure at which the muscle fits the rig with no load at all.
        pressure = np.minimum(pressure, 470e3)
        ramp = np.clip((time - START_S) / g.uniform(0.3, 1.5), 0.0, 1.0)
        load = np.minimum(load, loads_at(float(pressure.min()))[1]) * ramp
    motor, regulator = volts(pressure, load)
    if loose:
        motor[time <= START_S] = 0.0
    return motor, regulator


def volts(pressure: Array, load: Array) -> tuple[Array, Array]:
    """Motor and regulator voltages for pressures (Pa) and loads (N), by the lab's numbers."""
    # What is logged, in whole millivolts, is what was sent.
    return np.clip(
        np.round((load - NOMINAL["drive_offset"]) / NOMINAL["drive_gain"], 3), 0.0, 10.0
    ), np.clip(
        np.round((pressure - NOMINAL["regulator_offset"]) / NOMINAL["regulator_gain"], 3), 0.0, 10.0
    )


def _pressure(g: Generator, deep: bool = False) -> float:
    return float(g.uniform(200e3, 245e3) if deep else g.uniform(200e3, 540e3))


def _stairs(g: Generator, time: Array, low: float, high: float, gap: tuple[float, float]) -> Array:
    """Random levels, a third of the range apart at least, each held for a while."""
    level = g.uniform(low, high)
    values = np.full(time.shape, level)
    at, end = START_S, time[-1] - HOLD_S
    while at < end:
        before = level
        while abs(level - before) < (high - low) / 3.0:
            level = g.uniform(low, high)
        values[time >= at] = level
        at += g.uniform(*gap)
    return values


def _zigzag(time: Array, levels: Array, pace: float) -> Array:
    """Straight lines from level to level, so fast that all fit in; `pace` a unit per s at least."""
    distances = np.abs(np.diff(levels)) + 1e-9
    span = time[-1] - HOLD_S - START_S
    times = START_S + np.cumsum(distances) * min(1.0 / pace, span / distances.sum())
    return np.interp(time, np.r_[START_S, times], levels)


def _sines(g: Generator, time: Array, low: float, high: float, fastest: float) -> Array:
    """Six tones between two levels, faded in and out."""
    wave = np.zeros(time.shape)
    for hertz in np.geomspace(0.15, fastest, 6) * g.uniform(0.9, 1.1, 6):
        wave += np.sin(2 * np.pi * (hertz * time + g.uniform())) / hertz**0.4
    wave /= np.abs(wave).max()
    fade = np.clip((time - START_S) / 0.5, 0, 1) * np.clip((time[-1] - HOLD_S - time) / 0.5, 0, 1)
    return 0.5 * (low + high) + 0.5 * (high - low) * wave * fade


def _triangles(g: Generator, time: Array, deepest: float) -> tuple[Array, Array]:
    pressure = _pressure(g, deepest < DEEPEST)
    low, high = loads_at(pressure, deepest)
    bottom, top = low + g.uniform(0, 0.3) * (high - low), low + g.uniform(0.7, 1) * (high - low)
    levels = np.resize([bottom, top], 2 * g.integers(1, 5) + 1)
    return np.full(time.shape, pressure), _zigzag(time, levels, g.uniform(60, 600))


def _load_steps(g: Generator, time: Array, deepest: float) -> tuple[Array, Array]:
    pressure = _pressure(g, deepest < DEEPEST)
    low, high = loads_at(pressure, deepest)
    return np.full(time.shape, pressure), _stairs(g, time, low, high, (0.5, 2.0))


def _pressure_steps(g: Generator, time: Array, deepest: float) -> tuple[Array, Array]:
    low, high = sorted(g.uniform(200e3, 540e3, 2))
    low, high = (low, high) if high - low > 80e3 else (220e3, 480e3)
    return _stairs(g, time, low, high, (0.6, 2.0)), np.full(time.shape, _common(g, low, high))


def _load_sines(g: Generator, time: Array, deepest: float) -> tuple[Array, Array]:
    pressure = _pressure(g, deepest < DEEPEST)
    low, high = loads_at(pressure, deepest)
    return np.full(time.shape, pressure), _sines(g, time, low, high, g.uniform(2.0, 6.0))


def _pressure_sines(g: Generator, time: Array, deepest: float) -> tuple[Array, Array]:
    low, high = g.uniform(200e3, 280e3), g.uniform(360e3, 530e3)
    return _sines(g, time, low, high, g.uniform(1.5, 4.0)), np.full(
        time.shape, _common(g, low, high)
    )


def _reversals(g: Generator, time: Array, deepest: float) -> tuple[Array, Array]:
    pressure = _pressure(g, deepest < DEEPEST)
    low, high = loads_at(pressure, deepest)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    shares = np.linspace(1.0, 0.15, g.integers(5, 10)) * g.uniform(0.8, 1.0)
    levels = np.r_[middle, middle + half * shares * np.resize([-1.0, 1.0], len(shares))]
    return np.full(time.shape, pressure), _zigzag(time, levels, g.uniform(150, 800))


def _both(g: Generator, time: Array, deepest: float) -> tuple[Array, Array]:
    low, high = g.uniform(220e3, 300e3), g.uniform(340e3, 450e3)
    pressure = _sines(g, time, low, high, g.uniform(1.0, 3.0))
    least, most = loads_at(high)[0], loads_at(low, deepest)[1]
    levels = g.uniform(least, max(most, least + 50), g.integers(4, 9))
    return pressure, _zigzag(time, levels, g.uniform(100, 500))


def _common(g: Generator, low: float, high: float) -> float:
    """A load that the rig bears from one pressure to another."""
    least, most = loads_at(high)[0], loads_at(low)[1]
    return float(g.uniform(least, max(most, least + 20.0)))


EXCITATIONS: dict[str, Callable[[Generator, Array, float], tuple[Array, Array]]] = {
    "triangles": _triangles,
    "load_steps": _load_steps,
    "pressure_steps": _pressure_steps,
    "load_sines": _load_sines,
    "pressure_sines": _pressure_sines,
    "reversals": _reversals,
    "both": _both,
}
"""Kinds of trials by name."""
