"""Trials that excite too little: what a lab may have that never meant to look for effects."""

from collections.abc import Callable

import numpy as np

from benchmarks.hidden_effects.generation.excitation import Generator, loads_at, volts
from benchmarks.hidden_effects.physics.rig import Array
from benchmarks.hidden_effects.physics.simulation import RATE

SECONDS, START_S = 6.0, 1.0
"""Length of a trial, and how long its first commands are held (s)."""

Asked = list[tuple[Array, Array]]
"""Pressure (Pa) and load (N) of each trial, shape (rows,)."""


def draw_low_excitation(generator: Generator, kind: str) -> tuple[Array, Array]:
    """Motor and regulator voltages of a kind of `LOW_EXCITATION`, shape (trials, rows) each."""
    time = np.arange(round(SECONDS * RATE)) / RATE
    sent = [volts(pressure, load) for pressure, load in LOW_EXCITATION[kind](generator, time)]
    return np.array([motor for motor, _ in sent]), np.array([regulator for _, regulator in sent])


def _range(g: Generator) -> tuple[float, float, float]:
    """A pressure (Pa), and loads (N) that are well within what the muscle bears there."""
    pressure = float(g.uniform(220e3, 500e3))
    low, high = loads_at(pressure)
    return pressure, low + 0.15 * (high - low), low + 0.85 * (high - low)


def _ramp(time: Array) -> Array:
    """From 0 to 1, held at both ends."""
    return np.clip((time - START_S) / (SECONDS - 2.0 * START_S), 0.0, 1.0)


def _held(g: Generator, time: Array) -> Asked:
    pressure, low, high = _range(g)
    return [(time * 0.0 + pressure, time * 0.0 + load) for load in g.uniform(low, high, 2)]


def _slow_ramp(g: Generator, time: Array) -> Asked:
    pressure, low, high = _range(g)
    begin, end = g.permutation([low, high]).tolist()
    ramp = begin + (end - begin) * _ramp(time)
    return [(time * 0.0 + pressure, ramp), (time * 0.0 + pressure, time * 0.0 + begin)]


def _small_moves(g: Generator, time: Array) -> Asked:
    pressure, low, high = _range(g)
    middle, swing = g.uniform(low, high), 0.03 * (high - low)
    waves = [middle + swing * np.sin(2.0 * np.pi * hertz * time) for hertz in (0.2, 0.4)]
    return [(time * 0.0 + pressure, wave) for wave in waves]


def _one_load(g: Generator, time: Array) -> Asked:
    pressure, low, high = _range(g)
    load = time * 0.0 + g.uniform(low, 0.5 * (low + high))
    slow = pressure + float(g.choice([-15e3, 15e3])) * _ramp(time)
    return [(slow, load), (time * 0.0 + pressure, load)]


def _one_pressure(g: Generator, time: Array) -> Asked:
    pressure, low, high = _range(g)
    still = time * 0.0 + pressure
    turns = [START_S + k * (SECONDS - 2.0 * START_S) / 4.0 for k in range(5)]
    fast = np.interp(time, turns, np.resize([low, high], 5))
    slow = low + (high - low) * (1.0 - np.abs(2.0 * _ramp(time) - 1.0))
    step = np.where(time > 0.5 * SECONDS, high, low)
    return [(still, fast), (still, slow), (still, step)]


LOW_EXCITATION: dict[str, Callable[[Generator, Array], Asked]] = {
    "held commands": _held,
    "one slow ramp": _slow_ramp,
    "small moves": _small_moves,
    "one load": _one_load,
    "one pressure": _one_pressure,
}
"""Kinds of data sets that excite little, by name."""
