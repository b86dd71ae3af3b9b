"""References that a lab moves its axis along, and how many files of what length it takes."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.rigs.rig import log_uniform

Array = np.ndarray

SHORTEST, LONGEST = 5.0, 300.0
"""Of a file (s)."""

ROWS = 150_000
"""Of all files of a case, at most; the shortest files are kept in any case."""

REST = 1.0
"""Every file begins with so long a rest, twice as long at most (s)."""


@dataclass(frozen=True)
class Reference:
    """A motion to follow, shape (rows,) each.

    Attributes:
        q: position (m, rad).
        v: speed.
        a: acceleration.
    """

    q: Array
    v: Array
    a: Array


def draw_lengths(rng: np.random.Generator, rate: float, frequency: float) -> list[float]:
    """Seconds of each file: three to six files of 5 s to 5 min, eight periods at least."""
    files = int(rng.integers(3, 7))
    least = max(SHORTEST, 8.0 / frequency)
    usual = log_uniform(rng, least, min(LONGEST, max(least, ROWS / rate / files)))
    return [round(usual * rng.uniform(0.8, 1.0) + 0.2 * least, 1) for _ in range(files)]


def draw_reference(
    rng: np.random.Generator, travel: float, frequency: float, rate: float, rows: int
) -> Reference:
    """Rest, then sums of sines, strokes at even speed, moves and dwells, or a chirp.

    Args:
        rng: what it is drawn from.
        travel: half of the stroke (m, rad).
        frequency: fastest (Hz).
        rate: of the rows (Hz).
        rows: how many.
    """
    shape = SHAPES[int(rng.integers(len(SHAPES)))]
    rest = REST * rng.uniform(1.0, 2.0)
    time = np.arange(rows) / rate - rest
    q = travel * shape(rng, frequency, np.maximum(time, 0.0)) * _smooth(time * frequency)
    v = np.gradient(q) * rate
    return Reference(q, v, np.gradient(v) * rate)


def _sines(rng: np.random.Generator, frequency: float, time: Array) -> Array:
    frequencies = frequency * np.array([0.23, 0.41, 0.67, 1.0]) * rng.uniform(0.9, 1.1, 4)
    sizes = rng.uniform(0.3, 1.0, 4) * np.array([1.0, 0.8, 0.6, 0.4])
    phases = rng.uniform(0.0, 2.0 * math.pi, 4)
    wave = np.sin(2.0 * math.pi * time[:, None] * frequencies + phases) @ sizes
    return wave / sizes.sum()


def _strokes(rng: np.random.Generator, frequency: float, time: Array) -> Array:
    """To and fro at even speed, with short rounded ends; the speed differs from file to file."""
    pace = frequency * rng.uniform(0.2, 0.5)
    turns = (pace * time) % 1.0
    triangle = 1.0 - 4.0 * np.abs(turns - 0.5)
    return np.sin(0.5 * math.pi * 0.94 * triangle) * 0.35 + triangle * 0.62


def _moves(rng: np.random.Generator, frequency: float, time: Array) -> Array:
    """Moves of least jerk between random places, with dwells between them."""
    lasting, dwelling = 0.9 / frequency, rng.uniform(0.3, 0.9) / frequency
    piece = np.floor(time / (lasting + dwelling)).astype(int)
    places = np.concatenate([[0.0], rng.uniform(-1.0, 1.0, int(piece.max()) + 2)])
    share = np.clip((time - piece * (lasting + dwelling)) / lasting, 0.0, 1.0)
    blend = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return places[piece] + (places[piece + 1] - places[piece]) * blend


def _chirp(rng: np.random.Generator, frequency: float, time: Array) -> Array:
    """From a tenth of the fastest to the fastest, smaller where it is fast."""
    span = max(float(time[-1]), 1e-9)
    low = frequency * rng.uniform(0.1, 0.2)
    growth = math.log(frequency / low)
    turns = low * span / growth * (np.exp(growth * time / span) - 1.0)
    return np.sin(2.0 * math.pi * turns) * (1.0 - 0.5 * time / span)


SHAPES: tuple[Callable[[np.random.Generator, float, Array], Array], ...] = (
    _sines,
    _strokes,
    _moves,
    _chirp,
)
"""Of references, in -1 to 1."""


def _smooth(periods: Array) -> Array:
    """From 0 at the end of the rest to 1 a period later."""
    share = np.clip(periods, 0.0, 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
