"""Leapfrog: positions half a step, velocities a whole one, positions half a step; many lanes.

Velocities are damped by the trapezoidal rule, for damping over mass is 5800 1/s. Two trials in two
lanes do not see each other. Sensors only follow, so they are filtered a block of steps at a time.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.physics.rig import (
    BANDWIDTH,
    ROTOR_DAMPING,
    Array,
    Hidden,
    Moment,
    Numbers,
    resistance,
    stiffness,
    tension,
)

RATE = 128
"""Rows a second."""

SUBSTEPS = 32
"""Steps a row."""

BLOCK = 16
"""Rows that are simulated before the sensors' filters catch up."""


@dataclass
class Commands:
    """Commands of lanes, joined linearly between rows.

    Attributes:
        motor: (V), shape (lanes, rows).
        regulator: (V), shape (lanes, rows).
        order: how many trials were made before, shape (lanes,).
    """

    motor: Array
    regulator: Array
    order: Array


def simulate(commands: Commands, rig: Numbers, hidden: Sequence[Hidden] = ()) -> Array:
    """What the sensors would read without noise and rounding.

    Args:
        commands: of every lane.
        rig: parameters of every lane, shape (lanes,) each.
        hidden: effects at work.
    Returns:
        Contraction, rotation, load, pressure (SI), shape (lanes, rows, 4).
    """
    lanes, rows = commands.motor.shape
    step = 1.0 / (RATE * SUBSTEPS)
    moment = equilibrium(commands, rig, hidden, step)
    sensors = _Sensors(moment, hidden, lanes)
    readings = np.empty((lanes, rows, 4))
    readings[:, 0] = sensors.filtered
    for first in range(0, rows - 1, BLOCK):
        count = min(BLOCK, rows - 1 - first) * SUBSTEPS
        middles = (np.arange(count, dtype=np.float64) + first * SUBSTEPS + 0.5) * step
        loads = _loads(commands, rig, hidden, middles, step)
        asked = _pressures(commands, rig, hidden, middles, step)
        filtered = sensors.follow(_integrate(moment, hidden, loads, asked), step)
        for i, signal in enumerate(filtered):
            kept = signal[SUBSTEPS - 1 :: SUBSTEPS].T
            readings[:, first + 1 : first + 1 + kept.shape[1], i] = kept
    return readings


def equilibrium(commands: Commands, rig: Numbers, hidden: Sequence[Hidden], step: float) -> Moment:
    """The rig at rest under its first commands, all memories empty."""
    start = np.zeros(1)
    load = _loads(commands, rig, hidden, start, step, once=True)[0]
    pressure = _pressures(commands, rig, hidden, start, step, once=True)[0]
    none = np.zeros_like(load)
    moment = Moment(
        step, rig, none, commands.order, none, none, none, none, pressure, pressure, load, load
    )
    moment.resting = resting = _balance(moment, none, hidden)
    # A ripple changes the load with the angle, the angle with the load: a few rounds settle it.
    for _ in range(12):
        pull = _total((effect.pull(moment) for effect in hidden), none)
        moment.tension = np.maximum(load + pull, 0.0)
        moment.contraction = _balance(moment, moment.tension, hidden)
        slack = _total((effect.slack() for effect in hidden), none)
        taut = resting - moment.contraction + slack + moment.tension / rig["cable_stiffness"]
        moment.angle = np.where(moment.tension > 0.0, taut / rig["radius"], 0.0)
    for effect in hidden:
        effect.begin(moment)
    return moment


def _integrate(moment: Moment, hidden: Sequence[Hidden], loads: Array, asked: Array) -> list[Array]:
    """Go through a block of steps; contraction, angle, tension, pressure at their middles."""
    rig, step = moment.rig, moment.step
    half = 0.5 * step
    pace = (1.0 - np.exp(-step / rig["regulator_time"])) / step
    per_mass, per_inertia = step / rig["mass"], step / rig["inertia"]
    drag = half * ROTOR_DAMPING / rig["inertia"]
    slack = _total((effect.slack() for effect in hidden), np.zeros_like(moment.angle))
    out = [np.empty_like(loads) for _ in range(4)]
    for n in range(len(loads)):
        moment.asked, moment.load = asked[n], loads[n]
        rate = (moment.asked - moment.pressure) * pace
        for effect in hidden:
            rate = effect.flow(rate, moment)
        for effect in hidden:
            rate = rate + effect.chamber(moment)
        # Pressure, contraction and angle go to the middle, where forces are read.
        moment.pressure = pressure = moment.pressure + half * rate
        moment.contraction = contraction = moment.contraction + half * moment.velocity
        moment.angle = angle = moment.angle + half * moment.spin
        moment.tension = pulled = tension(
            rig["radius"] * angle + contraction - moment.resting - slack,
            rig["radius"] * moment.spin + moment.velocity,
            rig,
        )
        force = rig["force_slope"] * pressure + rig["force_intercept"] - pulled
        force = force - stiffness(pressure, rig) * contraction
        damping = resistance(pressure, moment.velocity, rig)
        torque = moment.load - pulled
        for effect in hidden:
            damping = damping * effect.damping(moment)
            force = force + effect.force(moment)
            torque = torque + effect.pull(moment)
        loss = 0.5 * per_mass * damping
        moment.velocity = (moment.velocity * (1.0 - loss) + per_mass * force) / (1.0 + loss)
        torque = rig["radius"] * torque
        moment.spin = (moment.spin * (1.0 - drag) + per_inertia * torque) / (1.0 + drag)
        for series, value in zip(out, (contraction, angle, pulled, pressure), strict=True):
            series[n] = value
        moment.pressure = pressure + half * rate
        moment.contraction = contraction + half * moment.velocity
        moment.angle = angle + half * moment.spin
    return out


class _Sensors:
    """First-order lags that follow the signals."""

    def __init__(self, moment: Moment, hidden: Sequence[Hidden], lanes: int) -> None:
        bandwidths = np.repeat(np.array(BANDWIDTH)[:, None], lanes, axis=1)
        for effect in hidden:
            bandwidths = effect.bandwidths(bandwidths)
        # As late, on a ramp, as the sensor itself; an exponential of the step would be later.
        late, half = 1.0 / (2.0 * np.pi * bandwidths), 0.5 * moment.step
        self.keep = (late - half) / (late + half)
        self.hidden = hidden
        signals = [moment.contraction, moment.angle, moment.tension, moment.pressure]
        rest = [signal[None, :] for signal in signals]
        for effect in hidden:
            rest = effect.sensed(rest, moment.step)
        self.filtered = np.stack([signal[0] for signal in rest], axis=1)

    def follow(self, signals: list[Array], step: float) -> list[Array]:
        """Lagged signals at the ends of the steps, for signals at their middles."""
        for effect in self.hidden:
            signals = effect.sensed(signals, step)
        out = []
        for i, signal in enumerate(signals):
            lagged = np.empty_like(signal)
            for keep in np.unique(self.keep[i]):
                own = self.keep[i] == keep
                memory = (keep * self.filtered[own, i])[None, :]
                lagged[:, own], _ = lfilter([1.0 - keep], [1.0, -keep], signal[:, own], 0, memory)
            self.filtered[:, i] = lagged[-1]
            out.append(lagged)
        return out


def _loads(
    commands: Commands,
    rig: Numbers,
    hidden: Sequence[Hidden],
    times: Array,
    step: float,
    once: bool = False,
) -> Array:
    """Loads (N) that the drive gives, shape (times, lanes); `once` leaves memories out."""
    late = _total((effect.motor_delay() for effect in hidden), np.zeros(len(commands.order)))
    volts = _interpolated(commands.motor, times, late)
    loads = np.maximum(rig["drive_gain"] * volts + rig["drive_offset"], 0.0)
    for effect in hidden:
        loads = effect.loads(loads, 0.0 if once else step)
    return loads


def _pressures(
    commands: Commands,
    rig: Numbers,
    hidden: Sequence[Hidden],
    times: Array,
    step: float,
    once: bool = False,
) -> Array:
    """Pressures (Pa) asked for, shape (times, lanes)."""
    late = _total((effect.regulator_delay() for effect in hidden), np.zeros(len(commands.order)))
    volts = _interpolated(commands.regulator, times, late)
    asked = np.maximum(rig["regulator_gain"] * volts + rig["regulator_offset"], 0.0)
    for effect in hidden:
        asked = effect.pressures(asked, 0.0 if once else step)
    return asked


def _interpolated(columns: Array, times: Array, late: Array) -> Array:
    rows = np.arange(columns.shape[1]) / RATE
    pairs = zip(columns, late, strict=True)
    return np.stack([np.interp(times - delay, rows, column) for column, delay in pairs], axis=1)


def _balance(moment: Moment, load: Array, hidden: Sequence[Hidden]) -> Array:
    """Contraction (m) at which the muscle balances a load (N)."""
    rig, holding = moment.rig, [effect for effect in hidden if effect.static]
    spring = stiffness(moment.pressure, rig)
    force = rig["force_slope"] * moment.pressure + rig["force_intercept"] - load
    moment.contraction = force / spring
    # Effects that stiffen the muscle up to sixfold still converge.
    for _ in range(100 if holding else 0):
        rest = force - spring * moment.contraction
        rest = rest + _total((effect.force(moment) for effect in holding), 0.0 * rest)
        moment.contraction = moment.contraction + 0.3 * rest / spring
    return moment.contraction


def _total(values: Iterable[Array | float], total: Array) -> Array:
    for value in values:
        total = total + value
    return total
