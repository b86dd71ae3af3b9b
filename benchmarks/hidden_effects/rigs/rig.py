"""The axis of a lab: inertia, damping, spring and gravity, and how large and fast it moves.

A part on a testing machine: a seal under pressure, a brake, a spring.

References that a lab moves its axis along, and how many files of what length it takes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

GRAVITY = 9.80665
"""m/s^2."""

RATES = (100.0, 200.0, 250.0, 500.0, 1000.0, 2000.0)
"""Sampling rates of logs (Hz)."""

ACCELERATION, SPEED = 15.0, 1.5
"""Largest of a slide (m/s^2, m/s)."""

TURNING = {"acceleration": 400.0, "speed": 15.0}
"""Largest of a joint (rad/s^2, rad/s)."""


@dataclass(frozen=True)
class Rig:
    """One axis.

        inertia q'' = u - damping q' - stiffness q - gravity sin(q + gravity_angle)

    Attributes:
        kind: `slide` (m, N) or `joint` (rad, N m).
        inertia: mass or moment of inertia (kg, kg m^2).
        damping: viscous (N s/m, N m s).
        stiffness: of the spring about q = 0 (N/m, N m/rad); 0 without.
        gravity: m g l of a joint (N m); 0 without.
        gravity_angle: q is this far from hanging down (rad).
        travel: half of the stroke that is used (m, rad).
        frequency: fastest of the reference (Hz).
        rate: of the log (Hz).
    """

    kind: str
    inertia: float
    damping: float
    stiffness: float
    gravity: float
    gravity_angle: float
    travel: float
    frequency: float
    rate: float

    @property
    def peak_speed(self) -> float:
        """Of a sine over the whole stroke (m/s, rad/s)."""
        return 2.0 * math.pi * self.frequency * self.travel

    @property
    def peak_force(self) -> float:
        """That such a sine takes of inertia, damping, spring and gravity, added up (N, N m)."""
        omega = 2.0 * math.pi * self.frequency
        moving = (self.inertia * omega + self.damping) * omega * self.travel
        return moving + self.stiffness * self.travel + self.gravity * min(1.0, self.travel)


def draw_slide(rng: np.random.Generator, springs: bool) -> Rig:
    """A slide: strokes of 1 mm to 1 m, 0.05 to 200 kg; with springs two times in five."""
    travel = log_uniform(rng, 0.5e-3, 0.5)
    mass = log_uniform(rng, 0.05, 200.0)
    frequency = _frequency(rng, travel, ACCELERATION, SPEED)
    return _drawn(rng, "slide", mass, travel, frequency, rng.random() < 0.4 and springs, 0.0)


def draw_joint(rng: np.random.Generator) -> Rig:
    """A joint: 0.05 to 2 rad to each side, 1e-5 to 10 kg m^2; gravity and spring in some."""
    travel = log_uniform(rng, 0.05, 2.0)
    inertia = log_uniform(rng, 1e-5, 10.0)
    frequency = _frequency(rng, travel, TURNING["acceleration"], TURNING["speed"])
    omega = 2.0 * math.pi * frequency
    gravity = inertia * (omega * rng.uniform(0.4, 1.0)) ** 2 if rng.random() < 0.4 else 0.0
    return _drawn(rng, "joint", inertia, travel, frequency, rng.random() < 0.3, gravity)


def _frequency(rng: np.random.Generator, travel: float, acceleration: float, speed: float) -> float:
    most = min(
        8.0, math.sqrt(acceleration / travel) / 2.0 / math.pi, speed / travel / 2.0 / math.pi
    )
    return log_uniform(rng, 0.3 * most, most)


def _drawn(
    rng: np.random.Generator,
    kind: str,
    inertia: float,
    travel: float,
    frequency: float,
    spring: bool,
    gravity: float,
) -> Rig:
    omega = 2.0 * math.pi * frequency
    damping = inertia * omega * log_uniform(rng, 0.1, 1.5)
    stiffness = inertia * (omega * rng.uniform(0.7, 2.5)) ** 2 if spring else 0.0
    rate = float(rng.choice([rate for rate in RATES if rate >= 30.0 * frequency]))
    # A whole number of milliradians: it is written into a file.
    angle = round(rng.uniform(-0.3, 0.3), 3) if gravity else 0.0
    return Rig(kind, inertia, damping, stiffness, gravity, angle, travel, frequency, rate)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform between two ends."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


SLOWEST_HZ = 5.0
"""Bandwidth of the slowest machines."""


@dataclass(frozen=True)
class ImposedRig:
    """A part that another drive moves, and whose force is measured.

        force = mass q'' + damping q' + stiffness q + area pressure

    Attributes:
        kind: `imposed`.
        mass: that moves beyond the load cell (kg).
        damping: viscous (N s/m).
        stiffness: (N/m); 0 without.
        area: that pressure acts on (m^2); 0 without.
        pressures: of each file (Pa).
        travel: half of the stroke (m).
        frequency: fastest of the motion (Hz).
        rate: of the log (Hz).
    """

    kind: str
    mass: float
    damping: float
    stiffness: float
    area: float
    pressures: tuple[float, ...]
    travel: float
    frequency: float
    rate: float

    gravity: ClassVar[float] = 0.0

    @property
    def bandwidth(self) -> float:
        """Of the machine (Hz): it turns within a tenth of a second, or of its fastest period."""
        return min(max(SLOWEST_HZ, 8.0 * self.frequency), self.rate / 10.0)

    @property
    def peak_speed(self) -> float:
        """Of a sine over the whole stroke (m/s)."""
        return 2.0 * math.pi * self.frequency * self.travel

    @property
    def peak_force(self) -> float:
        """Change of the force over such a sine, all parts added up (N)."""
        omega = 2.0 * math.pi * self.frequency
        moving = (self.mass * omega + self.damping) * omega * self.travel
        return moving + self.stiffness * self.travel + 0.05 * self.area * max(self.pressures)


def draw_imposed(rng: np.random.Generator, files: int) -> ImposedRig:
    """A seal under pressure, a brake or a spring on a testing machine: strokes of 1 mm to 1 m."""
    travel = log_uniform(rng, 0.5e-3, 0.5)
    # Testing machines are slow.
    frequency = min(log_uniform(rng, 0.1, 2.0), 0.5 / travel / 2.0 / math.pi)
    scale = log_uniform(rng, 1.0, 3000.0)
    area, stiffness, pressures = 0.0, 0.0, (0.0,) * files
    shape = str(rng.choice(("seal", "brake", "spring")))
    if shape == "seal":
        area = scale / 4e5
        pressures = tuple(float(round(1e5 * rng.uniform(1.0, 7.0), -3)) for _ in range(files))
    elif shape == "spring":
        stiffness = scale / travel
    damping = scale * rng.uniform(0.05, 0.3) / (2.0 * math.pi * frequency * travel)
    mass = log_uniform(rng, 0.05, 20.0)
    rates = [rate for rate in RATES if rate >= 100.0 * frequency and rate <= 1000.0]
    rate = float(rng.choice(rates))
    return ImposedRig("imposed", mass, damping, stiffness, area, pressures, travel, frequency, rate)


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
