"""Logs of other rigs, made by equations of their own: no line of the package's plant is in them.

The muscle's station comes from the independent generator in `benchmarks.hidden_effects`, at 2 kHz,
and is logged as a lab would: at its rate, with its channels, with its mishaps.
"""

from functools import cache
from pathlib import Path
from unittest import mock

import numpy as np

from benchmarks.hidden_effects.physics import simulation
from benchmarks.hidden_effects.physics.drive import CommandDelay
from benchmarks.hidden_effects.physics.muscle import Bristles, Dashpots, MaxwellSlip
from benchmarks.hidden_effects.physics.rig import DAQ_STEP, NOISE, NOMINAL, SIGNALS, UNITS, VOLTS
from pma_gym.data.trial import Trial

FROZEN = Path(__file__).parent / "rigs"

FASTEST, SUBSTEPS = 2000, 2
KNOT_S = 0.02
"""Commands are straight between these times, so that logs at 50 Hz and above hold them whole."""

OFF = {"drive_gain": 1.03, "force_slope": 0.97}
STEPS = np.array([DAQ_STEP / gain for gain, _ in VOLTS]) * np.array(UNITS)

HIDDEN = {
    "nothing": lambda lanes: [],
    "hysteresis": lambda lanes: [MaxwellSlip(np.full(lanes, 8.0), 1.5e-3)],
    "drive_delay": lambda lanes: [CommandDelay(np.full(lanes, 6e-3))],
}
"""What may be wrong with the station, by the name that a diagnosis gives it."""


def commands(lanes, seconds, seed=5):
    """Motor and regulator volts of lanes at their knots: triangles, steps, sums of sines."""
    generator = np.random.default_rng(seed)
    time = np.arange(round(seconds / KNOT_S) + 1) * KNOT_S
    along = np.clip((time - 0.3) / (seconds - 0.8), 0.0, 1.0)
    moving = (time > 0.3) & (time < seconds - 0.5)
    motor, regulator = [], []
    for lane in range(lanes):
        held = (generator.uniform(220.0, 500.0) + 20.4) / 59.9 + 0.0 * time
        phases = generator.uniform(0.0, 6.0, 4)
        tones = zip((0.4, 0.7, 1.3, 2.1), phases, strict=True)
        waves = sum(np.sin(2 * np.pi * hertz * time + phase) for hertz, phase in tones)
        triangle = 1.0 + generator.uniform(3.0, 4.0) * (1.0 - np.abs(2.0 * along - 1.0))
        jumps = held + 0.9 * ((along > 0.35) & (along < 0.7)) - 0.7 * ((along > 0.7) & moving)
        pull = 1.0 + 2.0 * ((along > 0.1) & (along < 0.9))
        motor.append((triangle, pull, 2.5 + 0.4 * np.where(moving, waves, 0.0))[lane % 3])
        regulator.append((held, jumps, held)[lane % 3])
    return time, np.array(motor), np.array(regulator)


@cache
def station(lanes=12, seconds=4.0, hidden="hysteresis"):
    """Knots, volts at them, and what noiseless sensors read at 2 kHz, shape (lanes, rows, 4)."""
    knots, motor, regulator = commands(lanes, seconds)
    time = np.arange(round(seconds * FASTEST) + 1) / FASTEST
    volts = [np.array([np.interp(time, knots, row) for row in rows]) for rows in (motor, regulator)]
    rig = {name: np.full(lanes, OFF.get(name, 1.0) * value) for name, value in NOMINAL.items()}
    with mock.patch.multiple(simulation, RATE=FASTEST, SUBSTEPS=SUBSTEPS):
        read = simulation.simulate(
            simulation.Commands(volts[0], volts[1], np.zeros(lanes)), rig, HIDDEN[hidden](lanes)
        )
    return knots, motor, regulator, time, read


def logged(lane, times, hidden="hysteresis", lanes=12, seconds=4.0, step=True):
    """A trial of the station, logged at some times (s), with noise and the DAQ's steps."""
    knots, motor, regulator, fine, read = station(lanes, seconds, hidden)
    generator = np.random.default_rng(1000 + lane)
    held = np.stack([np.interp(times, fine, read[lane, :, i]) for i in range(4)], axis=1)
    held = held + generator.standard_normal(held.shape) * np.array(NOISE) * np.array(UNITS)
    held = np.round(held / STEPS) * STEPS if step else held
    commands = {
        "motor_voltage": np.interp(times, knots, motor[lane]),
        "regulator_voltage": np.interp(times, knots, regulator[lane]),
    }
    return Trial(times, commands, dict(zip(SIGNALS, held.T, strict=True)))


def at(rate, seconds=4.0):
    """Times of a log (s)."""
    return np.arange(int(seconds * rate) + 1) / rate


SLIDE = {"mass": 5.3, "viscous": 46.0}
"""What the driven slide is (kg, N s/m); its model believes 5 and 50."""

LONGEST_S = 4e-5
"""Longest step of the driven slide."""

SLIDE_NOISE = 1e-5
"""Standard deviation of its position sensor (m)."""


@cache
def driven_slide(friction=0.0, lanes=4, seconds=4.0, rate=250, seed=31, static=1.3, speed=6e-3):
    """Trials of a slide that a controller drives to and fro, pushing and pulling, while it drifts.

    The controller sees the noisy position that is logged, so that its command goes with the noise.
    The load is straight between rows. Friction of the slide (N) is LuGre's; `static` times as large
    at rest, it falls with the speed (m/s) as Stribeck has it.
    """
    # Positions err by 1e-7 m; in steps of 0.6 ms by 2e-6 m, and up to the noise.
    generator, substeps = np.random.default_rng(seed), round(1.0 / (rate * LONGEST_S))
    step, rows = 1.0 / (rate * substeps), round(seconds * rate) + 1
    gains = 4500.0, 240.0
    phases, drift = generator.uniform(0, 6, (lanes, 3)), generator.uniform(-20e-3, 20e-3, lanes)
    hertz, sizes = np.array([0.35, 0.8, 1.7]), np.array([18e-3, 9e-3, 4e-3])
    bristles = Bristles(8e-6, static, speed)
    bristles.begin(lanes)

    def wished(time):
        return drift * time + np.sin(2 * np.pi * hertz * time + phases) @ sizes

    position, seen = wished(0.0), wished(0.0)
    velocity = (wished(step) - position) / step
    loads, log = np.zeros((rows + 1, lanes)), np.zeros((rows, lanes))
    for row in range(rows):
        time = row / rate
        before, seen = seen, position + SLIDE_NOISE * generator.standard_normal(lanes)
        log[row] = seen
        off = wished(time) - seen
        speed = (wished(time) - wished(time - 1 / rate) - (seen - before)) * rate
        loads[row + 1] = -(gains[0] * off + gains[1] * speed)
        for k in range(substeps):
            share = (k + 0.5) / substeps
            load = loads[row] + share * (loads[row + 1] - loads[row])
            position = position + 0.5 * step * velocity
            dry = friction * bristles.deflect(velocity, step)
            push = step * (-load - dry) / SLIDE["mass"]
            lost = 0.5 * step * SLIDE["viscous"] / SLIDE["mass"]
            velocity = (velocity * (1.0 - lost) + push) / (1.0 + lost)
            position = position + 0.5 * step * velocity
    time = np.arange(rows) / rate
    return [
        Trial(time, {"load_command": loads[:rows, i]}, {"contraction": log[:, i]})
        for i in range(lanes)
    ]


WEIGHTS_KG = (12.0, 22.0, 33.0)
GRAVITY = 9.80665


@cache
def hanging_load(hidden="nothing", seconds=4.5, rate=50):
    """Trials of a muscle that lifts weights by steps of pressure; no motor, no pulley's sensor.

    Weights on a cable over a pulley are a load M g and an inertia M r^2 there.
    """
    weights, lanes = np.array(WEIGHTS_KG), len(WEIGHTS_KG)
    generator = np.random.default_rng(77)
    knots = np.arange(round(seconds / KNOT_S) + 1) * KNOT_S
    levels = generator.uniform(230.0, 500.0, (lanes, 5))
    turns = np.array([0.4, 1.3, 2.2, 3.1, 4.2])
    kpa = np.stack([row[np.searchsorted(turns, knots, "right").clip(0, 4)] for row in levels])
    rig = {name: np.full(lanes, OFF.get(name, 1.0) * value) for name, value in NOMINAL.items()}
    rig |= {"drive_gain": np.ones(lanes), "drive_offset": weights * GRAVITY}
    rig |= {"inertia": weights * rig["radius"] ** 2 + 1e-5}
    volts = (kpa * 1e3 - rig["regulator_offset"][:, None]) / rig["regulator_gain"][:, None]
    effects = [Dashpots(np.full(lanes, 3e3), (0.7,))] if hidden == "creep" else []
    time = np.arange(round(seconds * FASTEST) + 1) / FASTEST
    volts_of_lanes = np.array([np.interp(time, knots, row) for row in volts])
    with mock.patch.multiple(simulation, RATE=FASTEST, SUBSTEPS=SUBSTEPS):
        commands = simulation.Commands(0.0 * volts_of_lanes, volts_of_lanes, np.zeros(lanes))
        read = simulation.simulate(commands, rig, effects)
    rows = slice(None, None, FASTEST // rate)
    trials = []
    for lane in range(lanes):
        noise = generator.standard_normal((len(time[rows]), 4)) * np.array(NOISE) * np.array(UNITS)
        held = np.round((read[lane, rows] + noise) / STEPS) * STEPS
        trials.append(
            Trial(
                time[rows],
                {
                    "load_command": np.full(len(held), weights[lane] * GRAVITY),
                    "regulator_voltage": volts_of_lanes[lane, rows],
                },
                {"contraction": held[:, 0], "pressure": held[:, 3]},
            )
        )
    return trials


def one_long_trial(seconds=120.0, rate=50, seed=9):
    """A station that is never put to rest: load and pressure wander for minutes, hysteresis in it.

    30 s of it are frozen in `rigs/`.
    """
    generator = np.random.default_rng(seed)
    knots = np.arange(round(seconds / KNOT_S) + 1) * KNOT_S
    turns = np.r_[0.0, 0.5 + np.cumsum(generator.uniform(0.3, 1.5, int(2 * seconds)))]
    pulls = np.r_[1.5, 1.5, generator.uniform(0.8, 4.5, len(turns) - 2)]
    kpa = np.r_[300.0, 300.0, generator.uniform(220.0, 480.0, len(turns) - 2)]
    kpa[np.arange(len(turns)) % 4 != 0] = 300.0
    motor = np.interp(knots, turns, pulls)
    regulator = (np.interp(knots, turns, kpa) + 20.4) / 59.9
    time = np.arange(round(seconds * FASTEST) + 1) / FASTEST
    commands = [np.interp(time, knots, row)[None] for row in (motor, regulator)]
    rig = {name: np.full(1, OFF.get(name, 1.0) * value) for name, value in NOMINAL.items()}
    with mock.patch.multiple(simulation, RATE=FASTEST, SUBSTEPS=SUBSTEPS):
        given = simulation.Commands(commands[0], commands[1], np.zeros(1))
        read = simulation.simulate(given, rig, HIDDEN["hysteresis"](1))
    rows = slice(None, None, FASTEST // rate)
    noise = generator.standard_normal((len(time[rows]), 4)) * np.array(NOISE) * np.array(UNITS)
    held = np.round((read[0, rows] + noise) / STEPS) * STEPS
    volts = {"motor_voltage": commands[0][0, rows], "regulator_voltage": commands[1][0, rows]}
    return Trial(time[rows], volts, {"contraction": held[:, 0], "load": held[:, 2]})
