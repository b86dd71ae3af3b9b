"""Drawing a case: excitations, a rig that differs from what the lab believes, an effect, noise.

The blocks of the target table: what their cases hide, and how large.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.generation.effect_size import (
    Experiment,
    Ruler,
    describe,
    neighbours,
    odds_of_parameters,
    scale_to,
    simulate_variants,
)
from benchmarks.hidden_effects.generation.effects import ALL, KINDS, OUTSIDE, Values
from benchmarks.hidden_effects.generation.excitation import EXCITATIONS, draw_trial
from benchmarks.hidden_effects.generation.readout_noise import UGLY, ReadoutNoise, draw_noise
from benchmarks.hidden_effects.physics import rig as rigs
from benchmarks.hidden_effects.physics.rig import NOMINAL, SENSORS, UNITS, Array
from benchmarks.hidden_effects.physics.simulation import RATE, Commands

SCALED_TOGETHER = (
    ("force_slope",),
    ("force_intercept",),
    ("stiffness_low", "stiffness_low_slope", "stiffness_high", "stiffness_high_slope"),
    ("damping_contracting",),
    ("damping_relaxing", "damping_high", "damping_high_slope"),
    ("drive_gain",),
    ("radius",),
    ("inertia",),
    ("mass",),
    ("cable_stiffness",),
    ("regulator_time",),
)
"""Base parameters that are off by one factor."""

NEED_LOOSE = {"drive_dead_zone", "cable_slack"}
NEED_DEEP = {"passive_stretch"}
NEED_PRESSURE = {
    "regulator_asymmetry",
    "regulator_rate_limit",
    "regulator_delay",
    "regulator_deadband",
    "pressure_transducer_lag",
    "hose_resonance",
}
NEED_EARLY = {"warm_up"}
"""Effects that would hide from some draws of excitations, and so get some of their own."""

WEAK = 0.3
"""Ratio below which a hidden effect counts as not excited."""


@dataclass(frozen=True)
class Case:
    """A data set and the truth behind it.

    Attributes:
        time: (s), shape (rows,), of each trial.
        motor: (V) of each trial.
        regulator: (V) of each trial.
        readings: contraction, rotation, load, pressure in mm, deg, N, kPa, shape (rows, 4) each.
        repeat_of: by number of the trial, the earlier one that it repeats.
        truth: what nobody must read before the diagnosis is made.
        files: texts of its data set by name, where it is no station's.
    """

    time: list[Array]
    motor: list[Array]
    regulator: list[Array]
    readings: list[Array]
    repeat_of: Mapping[int, int]
    truth: dict[str, Any]
    files: Mapping[str, str] = field(default_factory=dict)


def draw_case(
    seed: int,
    number: int,
    block: str,
    effects: tuple[str, ...] | None = None,
    trials: int = 6,
    seconds: float = 8.0,
    ratio: tuple[float, float] = (0.5, 2.0),
    ugly: str = "",
) -> Case:
    """A case of a block; the same arguments give the same bits.

    Args:
        seed: of the whole set.
        number: of the case in it.
        block: one of `BLOCKS`.
        effects: what to hide; drawn if not given.
        trials: how many, the last of which repeats another.
        seconds: how long each is.
        ratio: range of the target ratio r, drawn evenly in its logarithm.
        ugly: what stands in the readings beside noise, one of `UGLY`; empty: nothing.
    """
    g = np.random.default_rng([seed, number])
    hidden = effects if effects is not None else _draw_effects(g, block)
    rig, factors = draw_rig(g, 0.25 if block == "parameters" else 0.10)
    names, commands, repeats = _draw_trials(g, rig, set(hidden), trials, seconds)
    levels, colours = g.uniform(0.7, 1.4, 4), g.uniform(0.0, 0.5, 4)
    measured = np.ones(commands.motor.shape, bool)
    experiment = Experiment(commands, measured, rigs.noise_levels(levels))
    largest = float(rig["drive_gain"] * commands.motor.max() + rig["drive_offset"])
    typical = {name: ALL[name].draw(g, largest) for name in hidden}
    targets = {name: float(np.exp(g.uniform(*np.log(ratio)))) for name in hidden}
    hidden_effects, clean = _hide(experiment, rig, typical, targets)
    beside = draw_noise(g, ugly)
    colours = np.array([beside.memory(i, colour) for i, colour in enumerate(colours.tolist())])
    readings = [
        _measured(g, clean[i], levels, colours, hidden_effects["parameters"], beside)
        for i in range(trials)
    ]
    time = np.arange(commands.motor.shape[1]) / RATE
    log_odds = {}
    if block == "parameters":
        log_odds = odds_of_parameters(experiment, rig, factors, SCALED_TOGETHER)
    truth = {
        "block": block,
        "effects": hidden_effects["effects"],
        "weak": [e["name"] for e in hidden_effects["effects"] if e["r"] < WEAK],
        "base_factors": factors,
        "base": rig,
        "log_odds": log_odds,
        "noise_factors": dict(zip(SENSORS, levels.tolist(), strict=True)),
        "noise_memory": dict(zip(SENSORS, colours.tolist(), strict=True)),
        "readout_noise": beside.describe(),
        "protocols": names,
        "joint_ratios": hidden_effects["joint"],
        "seed": seed,
        "number": number,
    }
    motor, regulator = list(commands.motor), list(commands.regulator)
    return Case([time] * trials, motor, regulator, readings, repeats, truth)


def draw_rig(g: np.random.Generator, most: float) -> tuple[dict[str, float], dict[str, float]]:
    """A rig whose parameters are off by up to a share, and by which factor each is.

    Up to 10 % every parameter is off with a chance of 0.7; beyond that one to three are, by at
    least 10 %.
    """
    factors: dict[str, float] = {}
    some = set(g.choice(len(SCALED_TOGETHER), g.integers(1, 4), replace=False).tolist())
    for i, together in enumerate(SCALED_TOGETHER):
        if most > 0.1:
            # Drive, radius and stiffness by a quarter would break what the excitations promise.
            reach = 0.15 if together[0] in ("force_slope", "stiffness_low", "drive_gain") else most
            off = g.choice([-1.0, 1.0]) * g.uniform(0.1, reach) if i in some else 0.0
        else:
            off = g.uniform(-most, most) if g.uniform() < 0.7 else 0.0
        factors |= {name: 1.0 + float(off) for name in together}
    rig = {name: value * factors.get(name, 1.0) for name, value in NOMINAL.items()}
    return rig, {name: factor for name, factor in factors.items() if factor != 1.0}


def _draw_effects(g: np.random.Generator, block: str) -> tuple[str, ...]:
    if block.startswith("nothing") or block == "parameters":
        return ()
    if block == "unknown":
        return (str(g.choice(list(OUTSIDE))),)
    count = 2 if block == "pair" else 1
    return tuple(str(name) for name in g.choice(list(KINDS), count, replace=False))


def _draw_trials(
    g: np.random.Generator, rig: Values, hidden: set[str], trials: int, seconds: float
) -> tuple[list[str], Commands, dict[int, int]]:
    """Names of excitations, commands, and which trial repeats which."""
    loose = set(g.choice(trials - 1, max(1, trials // 3), replace=False).tolist())
    loose |= {0, 1} if hidden & NEED_LOOSE else set()
    # Excitations differ as far as there are enough; five of them always move load and pressure.
    names = [str(n) for n in g.permutation(list(EXCITATIONS)).tolist()]
    if hidden & NEED_PRESSURE:
        names.sort(key=lambda name: name != "pressure_steps")
    if hidden & NEED_EARLY:
        names.sort(key=lambda name: "pressure" not in name)
    names = [names[i % len(names)] for i in range(trials - 1)]
    drawn = []
    for i, name in enumerate(names):
        deep = bool(hidden & NEED_DEEP) and i not in loose
        motor, regulator = draw_trial(g, name, seconds, i in loose, deep)
        for _ in range(50):
            if _bearable(rig, motor, regulator):
                break
            motor, regulator = draw_trial(g, name, seconds, i in loose, deep)
        drawn.append((name, motor, regulator))
    again = int(g.integers(trials - 1))
    drawn.append(drawn[again])
    names, motors, regulators = (list(column) for column in zip(*drawn, strict=True))
    commands = Commands(np.array(motors), np.array(regulators), np.arange(trials, dtype=float))
    return names, commands, {trials - 1: again}


def _bearable(rig: Values, motor: Array, regulator: Array) -> bool:
    """Whether the true rig stays within its limits, by its statics."""
    load = np.maximum(rig["drive_gain"] * motor + rig["drive_offset"], 0.0)
    pressure = rig["regulator_gain"] * regulator + rig["regulator_offset"]
    numbers = {name: np.array(value) for name, value in rig.items()}
    force = rig["force_slope"] * pressure + rig["force_intercept"]
    contraction = (force - load) / rigs.stiffness(pressure, numbers)
    inside = (contraction > -8e-3) & (contraction < 68e-3) & (load < 1050.0)
    return bool(np.all(inside & (pressure > 180e3) & (pressure < 565e3)))


def _hide(
    experiment: Experiment, rig: Values, typical: Mapping[str, Values], targets: Mapping[str, float]
) -> tuple[dict[str, Any], Array]:
    """Scale effects to their ratios; what they are, and clean readings with all of them."""
    if not typical:
        clean = simulate_variants(experiment.commands, [(rig, {})])[0]
        return {"effects": [], "joint": {}, "parameters": {}}, clean
    tried = {
        name: np.geomspace(1 / 64, min(ALL[name].most, 4.0), 6) if ALL[name].sized else np.ones(1)
        for name in typical
    }
    variants = [(rig, {}), *((near, {}) for near in neighbours(rig))]
    base = len(variants)
    variants += [
        (rig, {name: ALL[name].at(typical[name], float(size))})
        for name in typical
        for size in tried[name]
    ]
    readings = simulate_variants(experiment.commands, variants)
    ruler = Ruler(experiment, readings[0], readings[1:base])
    rows = iter(readings[base:])
    effects, parameters = [], {}
    clean = readings[0]
    for name in typical:
        known = {float(size): ruler.size(next(rows)) for size in tried[name]}
        args = (rig, name, typical[name], targets[name], known)
        size, clean = scale_to(ruler, experiment, *args)
        parameters[name] = ALL[name].at(typical[name], size)
        ratios = ruler.ratios(clean)
        effects.append(
            {
                "name": name,
                "parameters": {k: v for k, v in parameters[name].items()},
                "size": size,
                "target": targets[name],
                "r": round(float(ratios.max()), 4),
                "ratios": describe(ratios),
            }
        )
    if len(typical) > 1:
        clean = simulate_variants(experiment.commands, [(rig, parameters)])[0]
    joint = describe(ruler.ratios(clean))
    return {"effects": effects, "joint": joint, "parameters": parameters}, clean


def _measured(
    g: np.random.Generator,
    clean: Array,
    levels: Array,
    colours: Array,
    parameters: Mapping[str, Values],
    beside: ReadoutNoise,
) -> Array:
    """One trial's readings in file units: noise, a zero of the LVDT, the DAQ's rounding."""
    white = g.standard_normal(clean.shape)
    zero = g.normal(0.0, 0.1)
    added = beside.added(g, np.arange(len(clean)) / RATE)
    out = np.empty_like(clean)
    for i in range(4):
        memory = float(colours[i])
        start = [memory * float(g.standard_normal())]
        coloured, _ = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], white[:, i], zi=start)
        out[:, i] = clean[:, i] / UNITS[i] + rigs.NOISE[i] * levels[i] * (coloured + added[:, i])
    out[:, 0] += zero
    coarse = parameters.get("sensor_quantisation", {"signal": -1.0, "daq_steps": 1.0})
    for i, (gain, offset) in enumerate(rigs.VOLTS):
        step = rigs.DAQ_STEP * (coarse["daq_steps"] if i == coarse["signal"] else 1.0)
        volts = np.clip(gain * out[:, i] + offset, -10.0, 10.0 - rigs.DAQ_STEP)
        out[:, i] = (np.floor(volts / step + 0.5) * step - offset) / gain
    # Rotation counts from where the trial begins.
    out[:, 1] -= out[0, 1]
    return out


@dataclass(frozen=True)
class Block:
    """Cases of one kind.

    Attributes:
        name: of the block.
        turns: effects that cases take turns in, so that each is hidden equally often; where empty,
            `draw_case` decides what is hidden.
        ratio: range of r, what an effect changes beyond a refit over the noise.
        trials: of a case.
        seconds: of a trial (s).
        ugly: what stands in the readings beside noise (`readout_noise`); empty: nothing.
    """

    name: str
    turns: tuple[str, ...] = ()
    ratio: tuple[float, float] = (0.5, 2.0)
    trials: int = 6
    seconds: float = 8.0
    ugly: str = ""

    def draw(self, seed: int, number: int) -> Case:
        """Case of a number, 1 and up; the same seed and number give the same bits."""
        hidden = (self.turns[(number - 1) % len(self.turns)],) if self.turns else None
        drawn = (self.trials, self.seconds, self.ratio, self.ugly)
        return draw_case(seed, number, self.name, hidden, *drawn)


@dataclass(frozen=True)
class RigsBlock(Block):
    """Cases of other labs' rigs; of 600 cases 200 hide one effect, 100 two, 200 nothing."""

    def draw(self, seed: int, number: int) -> Case:
        """Case of a number, 1 and up; the same seed and number give the same bits."""
        # Here, for no other block needs its simulators.
        from benchmarks.hidden_effects.rigs.drawing import draw

        texts, truth = draw(seed, number)
        return Case([], [], [], [], {}, truth, texts)


@dataclass(frozen=True)
class LabBlock(Block):
    """Cases of ordinary troubles of a laboratory, which take turns, or of none."""

    def draw(self, seed: int, number: int) -> Case:
        """Case of a number, 1 and up; the same seed and number give the same bits."""
        # Here, for no other block needs its simulators.
        from benchmarks.hidden_effects.rigs.lab import draw

        texts, truth = draw(seed, number, self.name)
        return Case([], [], [], [], {}, truth, texts)


BLOCKS: dict[str, Block] = {
    block.name: block
    for block in (
        Block("single", tuple(KINDS)),
        Block("faint", tuple(KINDS), (0.3, 0.3)),
        Block("nothing"),
        Block("parameters"),
        Block("pair"),
        Block("unknown", tuple(OUTSIDE)),
        *(Block(f"single_{ugly}", tuple(KINDS), ugly=ugly) for ugly in UGLY),
        *(Block(f"nothing_{ugly}", ugly=ugly) for ugly in UGLY),
        Block("slow_drift", ("creep", "leakage", "warm_up"), ugly="drift"),
        RigsBlock("rigs"),
        LabBlock("lab"),
        LabBlock("lab_nothing"),
    )
}
"""By name, in the order of the table."""
