"""Cases that their data do not decide, but one further experiment does.

Both are fixed beforehand with the generator's own ruler, to first order about the true rig. The
hidden effect is set against the best that the base parameters, within what is known of them, could
do without it, and against every rival of another group, of free size. A case is untellable where
one of these is behind the truth by a log-likelihood of at most `UNTOLD`; it is tellable where a
excitation of the package's library gives the hidden effect a ratio r of at least `SHOWN`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.hidden_effects.generation.cases import BLOCKS as USUAL
from benchmarks.hidden_effects.generation.cases import Block, Case, draw_rig, measure
from benchmarks.hidden_effects.generation.effect_size import (
    SEEN,
    UNTOLD,
    Behind,
    Experiment,
    Ruler,
    describe,
    neighbours,
    simulate_variants,
)
from benchmarks.hidden_effects.generation.effects import ALL, KINDS, Values
from benchmarks.hidden_effects.generation.excitation import LOW_EXCITATION, draw_low_excitation
from benchmarks.hidden_effects.generation.files import named
from benchmarks.hidden_effects.generation.groups import group
from benchmarks.hidden_effects.physics import rig as rigs
from benchmarks.hidden_effects.physics.rig import SENSORS, Array
from benchmarks.hidden_effects.physics.simulation import RATE, Commands


@dataclass(frozen=True)
class RigsBlock(Block):
    """Cases of other labs' rigs; of 600 cases 200 hide one effect, 100 two, 200 nothing."""

    def draw(self, seed: int, number: int) -> Case:
        """Case of a number, 1 and up; the same seed and number give the same bits."""
        # Here, for no other block needs its simulators.
        from benchmarks.hidden_effects.rigs.drawing import draw

        texts, truth = draw(seed, number)
        return Case([], [], [], [], {}, truth, texts)


SHOWN = 0.5
"""Ratio r that the witness, an experiment of the library, gives the hidden effect at least."""

SIZES = np.geomspace(1 / 16, 4.0, 12)
"""Sizes that are tried in the witness, beside the largest that an effect may have."""

DRAWS = 60
"""Draws of a case before it is given up."""

_PRESSURE, _TRIANGLE, _STEP, _SWAPS, _SINES = (
    "pressure steps",
    "fast load triangle",
    "load step, held for 5 s",
    "load swaps",
    "multisine of load",
)

WITNESS: dict[str, str] = {
    "regulator_asymmetry": _PRESSURE,
    "regulator_rate_limit": _PRESSURE,
    "regulator_delay": _PRESSURE,
    "regulator_deadband": _PRESSURE,
    "pressure_transducer_lag": _PRESSURE,
    "filling": _PRESSURE,
    "hysteresis": _TRIANGLE,
    "coulomb_friction": _TRIANGLE,
    "bearing_friction": _TRIANGLE,
    "potentiometer_backlash": _TRIANGLE,
    "creep": _STEP,
    "drive_lag": _SWAPS,
    "drive_delay": _SWAPS,
    "load_cell_lag": _SWAPS,
    "lvdt_lag": _SWAPS,
    "potentiometer_lag": _SWAPS,
    "load_dependent_damping": _SINES,
    "nonlinear_stiffness": _SINES,
    "torque_ripple": _SINES,
    "current_imbalance": _SINES,
}
"""Effects of the block, and how the excitation of the library begins that would show each."""


@dataclass(frozen=True)
class LowExcitationBlock(Block):
    """The block of too little excitation."""

    def draw(self, seed: int, number: int) -> Case:
        """Case of a number, 1 and up; effects take turns."""
        return draw_undecidable(seed, number, self.turns[(number - 1) % len(self.turns)])


@dataclass(frozen=True)
class Rig:
    """A rig and its sensors, drawn.

    Attributes:
        numbers: its base parameters.
        factors: by which they are off.
        levels: of the sensors' noise.
        colours: memory of that noise.
    """

    numbers: dict[str, float]
    factors: dict[str, float]
    levels: Array
    colours: Array

    @classmethod
    def drawn(cls, g: np.random.Generator) -> "Rig":
        """At random."""
        return cls(*draw_rig(g, 0.10), g.uniform(0.7, 1.4, 4), g.uniform(0.0, 0.5, 4))

    def truth(self) -> dict[str, Any]:
        """As a case's truth has it."""
        return {
            "base_factors": self.factors,
            "base": self.numbers,
            "noise_factors": dict(zip(SENSORS, self.levels.tolist(), strict=True)),
            "noise_memory": dict(zip(SENSORS, self.colours.tolist(), strict=True)),
        }

    def experiment(self, motor: Array, regulator: Array) -> Experiment:
        """Commands on it, shape (trials, rows)."""
        commands = Commands(motor, regulator, np.arange(len(motor), dtype=float))
        return Experiment(commands, np.ones(motor.shape, bool), rigs.noise_levels(self.levels))


def draw_undecidable(seed: int, number: int, effect: str) -> Case:
    """A case that hides an effect which its data do not tell.

    Raises:
        ValueError: no draw kept both promises.
    """
    g = np.random.default_rng([seed, number])
    for _ in range(DRAWS):
        rig = Rig.drawn(g)
        shown = shown_by_library(g, rig, effect)
        if shown is None:
            continue
        for kind in g.permutation(list(LOW_EXCITATION)).tolist():
            motor, regulator = draw_low_excitation(g, kind)
            case = decided_case(g, rig.experiment(motor, regulator), rig.numbers, effect, shown)
            if case["untold"]:
                hidden = {**shown, "r": max(case["ratios"].values()), "ratios": case["ratios"]}
                truth = {"block": "undecidable", "effects": [hidden], **rig.truth()}
                truth |= {"kind": kind, "why": case, "seed": seed, "number": number}
                return _case(g, truth, motor, regulator)
    raise ValueError(f"case {number} of seed {seed}: no draw hides {effect} from its data")


def _case(g: np.random.Generator, truth: dict[str, Any], motor: Array, regulator: Array) -> Case:
    readings = measure(truth, motor, regulator, 0, g)
    time = np.arange(motor.shape[1]) / RATE
    return Case([time for _ in motor], list(motor), list(regulator), readings, {}, truth)


def shown_by_library(g: np.random.Generator, rig: Rig, effect: str) -> dict[str, Any] | None:
    """An effect of a size that its witness shows: name, parameters, and how large it is there.

    None where no size that was tried has a ratio from `SHOWN` to four times that.
    """
    excitation, (motor, regulator) = named(WITNESS[effect], g)
    experiment = rig.experiment(motor[None], regulator[None])
    typical, kind = ALL[effect].draw(g, 900.0), ALL[effect]
    sizes = [float(size) for size in SIZES if size <= kind.most]
    near = neighbours(rig.numbers)
    variants = [
        (rig.numbers, {}),
        *((each, {}) for each in near),
        *((rig.numbers, {effect: kind.at(typical, size)}) for size in sizes),
    ]
    readings = simulate_variants(experiment.commands, variants)
    ruler = Ruler(experiment, readings[0], readings[1 : 1 + len(near)])
    ratios = [ruler.size(each) for each in readings[1 + len(near) :]]
    good = [k for k, ratio in enumerate(ratios) if SHOWN <= ratio <= 4.0 * SHOWN]
    if not good:
        return None
    k = int(g.choice(good))
    return {
        "name": effect,
        "parameters": kind.at(typical, sizes[k]),
        "size": sizes[k],
        "witness": {"protocol": excitation, "r": round(ratios[k], 4)},
    }


def decided_case(
    g: np.random.Generator,
    experiment: Experiment,
    numbers: Values,
    effect: str,
    hidden: Mapping[str, Any],
) -> dict[str, Any]:
    """How far the truth is ahead of its rivals in some data, and whether that is too little.

    Args:
        g: draws the rivals' shapes.
        experiment: the commands.
        numbers: the true base parameters.
        effect: what is hidden.
        hidden: its `parameters`.
    Returns:
        Log-likelihood ratios to expect: of nothing hidden, of the rivals that are at most `UNTOLD`
        behind; `ratios` by signal; `untold`.
    """
    near = neighbours(numbers)
    variants = [
        (numbers, {}),
        *((each, {}) for each in near),
        (numbers, {effect: hidden["parameters"]}),
    ]
    base, *changed, truth = simulate_variants(experiment.commands, variants)
    behind = Behind(experiment, numbers, base, changed)
    nothing = behind.log_odds(truth)
    equal: dict[str, float] = {}
    if nothing >= SEEN:
        readings = _rivals(g, experiment, numbers, effect)
        odds = {name: behind.log_odds(truth, other) for name, other in readings.items()}
        equal = {name: round(each, 4) for name, each in odds.items() if each <= UNTOLD}
    return {
        "nothing": round(nothing, 4),
        "rivals": equal,
        "ratios": describe(Ruler(experiment, base, np.array(changed)).ratios(truth)),
        "untold": nothing <= UNTOLD or bool(equal),
    }


def _rivals(
    g: np.random.Generator, experiment: Experiment, numbers: Values, effect: str
) -> dict[str, Array]:
    """Readings with each effect of another group at its typical size."""
    rivals = {
        name: kind.at(kind.draw(g, 900.0), 1.0)
        for name, kind in KINDS.items()
        if name not in group(effect)
    }
    variants = [(numbers, {name: values}) for name, values in rivals.items()]
    return dict(zip(rivals, simulate_variants(experiment.commands, variants), strict=True))


BLOCKS: dict[str, Block] = USUAL | {
    "undecidable": LowExcitationBlock("undecidable", tuple(WITNESS), rounds=2),
    "rigs": RigsBlock("rigs"),
}
"""All blocks by name, in the order of the table."""
