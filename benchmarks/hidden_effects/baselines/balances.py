"""The station's balances at what was measured: what is missing in each, and who might add it.

Of forces on the slide (N), of the drive's load (N), of the pressure (kPa), of the way between
pulley and muscle (mm). Derivatives are of measured signals, made smooth over 0.1 s.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, minimum_filter1d
from scipy.signal import lfilter

from benchmarks.hidden_effects.baselines.preparation import Prepared
from benchmarks.hidden_effects.baselines.signatures import SLACK_N
from pma_gym.discovery.screening.candidates import PERIODS
from pma_gym.effects.effect import signals
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]
Terms = dict[str, Array]

SMOOTH_S = 0.02
"""Standard deviation (s) of the smoothing of measured signals."""

EVERY_S = 0.02
"""Time between rows that are regressed (s)."""

LATE_S = 0.02
"""By how much the regulator is taken to be late (s)."""


@dataclass(frozen=True)
class Balance:
    """One balance over all trials, each less its mean.

    Attributes:
        residual: shape (n,).
        base: what the model's own parameters could make of it, shape (k, n); taken out of both.
        terms: by name of the effect and, after a colon, of the term.
    """

    residual: Array
    base: Array
    terms: Terms


def balances(ready: Prepared) -> list[Balance]:
    """The station's balances at what was measured."""
    parts = [_of_trial(ready, logged, k) for k, logged in enumerate(ready.whitened.logged)]
    return [_joined([part[k] for part in parts]) for k in range(4)]


def _joined(parts: Sequence[tuple[Array, Sequence[Array], Terms]]) -> Balance:
    def centred(of: Sequence[Array]) -> Array:
        return np.concatenate([each - each.mean() for each in of])

    count = len(parts[0][1])
    return Balance(
        centred([part[0] for part in parts]),
        np.stack([centred([part[1][k] for part in parts]) for k in range(count)]),
        {name: centred([part[2][name] for part in parts]) for name in parts[0][2]},
    )


@dataclass(frozen=True)
class Motion:
    """One trial's measured signals and their derivatives, smooth (SI), shape (n,) each."""

    time: Array
    x: Array
    v: Array
    a: Array
    angle: Array
    spin: Array
    turn: Array
    load: Array
    pressure: Array
    pressure_rate: Array
    pressure_turn: Array
    motor: Array
    regulator: Array


def motion(ready: Prepared, logged: Logged) -> Motion:
    """Signals of a trial, smooth, and their derivatives, as far ahead as their sensors are late."""
    step = float(np.median(np.diff(logged.time)))
    width = max(1.0, SMOOTH_S / step)

    def smooth(values: Array, order: int = 0) -> Array:
        filtered = gaussian_filter1d(values, width, order=order, mode="nearest")
        return np.asarray(filtered) / step**order

    parameters = ready.refitted.model.parameters
    late = [1.0 / (2.0 * np.pi * parameters[signal.sensor].bandwidth) for signal in logged.signals]
    x, angle, load, pressure = (
        values + time * smooth(values, 1)
        for values, time in zip(logged.measured, late, strict=True)
    )
    return Motion(
        time=logged.time,
        x=smooth(x),
        v=smooth(x, 1),
        a=smooth(x, 2),
        angle=smooth(angle),
        spin=smooth(angle, 1),
        turn=smooth(angle, 2),
        load=smooth(load),
        pressure=smooth(pressure),
        pressure_rate=smooth(pressure, 1),
        pressure_turn=smooth(pressure, 2),
        motor=smooth(logged.motor),
        regulator=smooth(logged.regulator),
    )


def _of_trial(
    ready: Prepared, logged: Logged, number: int
) -> list[tuple[Array, Sequence[Array], Terms]]:
    """Residual, base and terms of slide, drive, pressure and way, in rows that are regressed."""
    m = motion(ready, logged)
    order = 0.0 if ready.orders is None else float(ready.orders[number])
    step = max(1, round(EVERY_S / float(np.median(np.diff(logged.time)))))
    margin = round(4 * SMOOTH_S / float(np.median(np.diff(logged.time))))
    every = np.arange(margin, max(margin + 1, len(logged.time) - margin), step)
    # A cable that snaps tight does so faster than any smooth derivative.
    near = minimum_filter1d(m.load, 2 * margin + 1)[every] > SLACK_N
    taut = every[near] if near.any() else every
    balances = (
        (taut, _slide(ready, m, order)),
        (taut, _drive(ready, m)),
        (every, _pressure(ready, m)),
        (taut, _way(ready, m)),
    )
    return [
        (residual[rows], [each[rows] for each in base], {k: v[rows] for k, v in terms.items()})
        for rows, (residual, base, terms) in balances
    ]


def _laws(ready: Prepared, port: str, **known: Array) -> Array:
    """Sum of the model's laws at a port, row by row, at measured signals."""
    model, total = ready.refitted.model, np.zeros(len(next(iter(known.values()))))
    for name, effect in model.effects.items():
        if effect.port == port and effect.law is not None:
            law, own = effect.law, model.parameters[name]
            columns = [known[each] for each in signals(law) if each != "p"]
            total += [law(*row, own) for row in zip(*map(np.ndarray.tolist, columns), strict=True)]
    return total


def _slide(ready: Prepared, m: Motion, order: float) -> tuple[Array, Sequence[Array], Terms]:
    """Forces on the slide (N): what pulls beyond muscle, damper and mass."""
    known = {"pressure": m.pressure, "contraction": m.x, "velocity": m.v}
    force = _laws(ready, "muscle_force", **known)
    damper = _laws(ready, "muscle_damping", **known) * m.v
    mass = ready.refitted.model.parameters["slide"].mass
    residual = m.load - (force - damper - mass * m.a)
    up, down = np.maximum(m.v, 0.0), np.minimum(m.v, 0.0)
    spring = ready.refitted.model.parameters.get("stiffness")
    high = m.pressure > getattr(spring, "breakpoint", np.inf)
    base = (m.pressure, m.x, m.x * m.pressure, m.x * high, m.x * m.pressure * high, up, down)
    base = (*base, down * m.pressure, m.a)
    fade = np.exp(-m.pressure / 100e3)
    terms = {
        "nonlinear_stiffness:x2": m.x**2,
        "nonlinear_stiffness:x3": m.x**3,
        "pressure_curvature:P2": m.pressure**2,
        "passive_stretch": np.minimum(m.x, 0.0),
        "load_dependent_damping:L": m.load * m.v,
        "load_dependent_damping:L2": m.load**2 * m.v,
        "coulomb_friction": np.tanh(m.v / 1e-3),
        "hysteresis": _play(m.x, 1.5e-3),
        "creep": m.x - _follow(m, m.x, 2.0),
        "slow_creep": m.x - _follow(m, m.x, 40.0),
        "warm_up": fade * np.exp(-order),
    }
    return residual, base, terms


def _drive(ready: Prepared, m: Motion) -> tuple[Array, Sequence[Array], Terms]:
    """The drive's load (N): what the load cell reads less what the command and the rotor give."""
    model = ready.refitted.model
    rotor = model.parameters["rotor"]
    asked = _laws(ready, "drive", motor_voltage=m.motor)
    inertia = rotor.inertia * m.turn + rotor.damping * m.spin
    residual = m.load - (asked - inertia / rotor.radius)
    most = float(np.max(asked))
    terms = {
        "bearing_friction": np.tanh(m.spin / 0.04),
        "drive_dead_zone": np.clip(asked, 0.0, 30.0),
        "drive_saturation": np.maximum(asked - 0.9 * most, 0.0),
        "drive_lag": _follow(m, asked, 0.01) - asked,
    }
    for periods in PERIODS:
        terms[f"torque_ripple:sin {periods}"] = m.load * np.sin(periods * m.angle)
        terms[f"torque_ripple:cos {periods}"] = m.load * np.cos(periods * m.angle)
    for periods in filter(lambda each: each <= 12, PERIODS):
        # A taut cable ties the shaft to the slide.
        shaft = -m.x / rotor.radius
        terms[f"current_imbalance:sin {periods}"] = m.load * np.sin(periods * shaft)
        terms[f"current_imbalance:cos {periods}"] = m.load * np.cos(periods * shaft)
    return residual, (asked, m.turn, m.spin), terms


def _pressure(ready: Prepared, m: Motion) -> tuple[Array, Sequence[Array], Terms]:
    """The pressure (kPa): how far its rate is from what the lag makes of the command."""
    model = ready.refitted.model
    asked = _laws(ready, "regulator_line", regulator_voltage=m.regulator)
    constant = model.parameters["regulator_lag"].time_constant
    gap = asked - m.pressure
    residual = (constant * m.pressure_rate - gap) / 1e3
    rate = m.pressure_rate / 1e5
    terms = {
        "regulator_asymmetry": np.minimum(rate, 0.0),
        "regulator_rate_limit": rate * np.abs(rate),
        "regulator_delay": (_late(m, asked, LATE_S) - asked) / 1e3,
        "regulator_deadband": np.clip(gap / 1e3, -3.0, 3.0),
        "pressure_transducer_lag": m.pressure_turn / 1e6,
        "filling": m.pressure * m.v / 1e4,
    }
    return residual, (m.pressure / 1e5, asked / 1e5), terms


def _way(ready: Prepared, m: Motion) -> tuple[Array, Sequence[Array], Terms]:
    """The way (mm) between what the pulley has wound in and what the muscle has given."""
    radius = ready.refitted.model.parameters["rotor"].radius
    residual = 1e3 * (radius * m.angle + m.x)
    terms = {
        "potentiometer_backlash": 1e3 * (_behind(m.angle, 0.5 * np.pi / 180.0) - m.angle),
        "lvdt_lag": -1e3 * m.v,
    }
    return residual, (1e3 * m.x, m.load), terms


def _follow(m: Motion, values: Array, time: float) -> Array:
    """A first-order lag (s) from where the trial begins."""
    keep = float(np.exp(-np.median(np.diff(m.time)) / time))
    filtered, _ = lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])
    return np.asarray(filtered)


def _late(m: Motion, values: Array, time: float) -> Array:
    """Values some time (s) ago."""
    return np.interp(m.time - time, m.time, values)


def _play(x: Array, distance: float) -> Array:
    """Force of friction that builds up over a way, -1 to 1."""
    output, state = np.zeros_like(x), 0.0
    for k in range(1, len(x)):
        state = min(1.0, max(-1.0, state + (x[k] - x[k - 1]) / distance))
        output[k] = state
    return output


def _behind(angle: Array, width: float) -> Array:
    """What follows an angle with a play of a width between."""
    output, state = np.empty_like(angle), float(angle[0])
    for k, value in enumerate(angle):
        state = min(value + 0.5 * width, max(value - 0.5 * width, state))
        output[k] = state
    return output
