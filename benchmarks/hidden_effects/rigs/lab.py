"""Cases of blocks `lab` and `lab_nothing`: ordinary troubles of a laboratory, and none.

A slide or a joint with ordinary dry friction, of which the lab's model knows, follows references
in a closed loop. The loop reads the drive's own encoder, so a trouble of the logged sensor leaves
the motion alone. Parameters of the model are 2 to 8 % off, and its friction slides a little before
it slips, which the true one does not. The rig, its motions and its noise depend on seed and number
alone: the same case without its trouble differs by nothing else.
"""

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from benchmarks.hidden_effects.rigs import files
from benchmarks.hidden_effects.rigs.driven_campaign import COLUMNS, DrivenCampaign
from benchmarks.hidden_effects.rigs.laws import (
    CoulombFriction,
    DeadBand,
    DriveGain,
    HiddenEffect,
)
from benchmarks.hidden_effects.rigs.rig import (
    RATES,
    Rig,
    draw_joint,
    draw_reference,
    draw_slide,
    log_uniform,
)
from benchmarks.hidden_effects.rigs.sensing import Noise, Sensor
from benchmarks.hidden_effects.rigs.simulators.stick_slip import Motion

Array = np.ndarray

TRIALS, PERIODS, SHORTEST = 3, 6.0, 5.0
"""Trials of a case, fastest periods of each, and its seconds at least."""

OFF = 0.02, 0.08
"""Range of the shares by which the lab's parameters are off."""

SIZES: dict[str, tuple[float, float]] = {
    "one_trial": (0.5, 1.5),
    "gain_drift": (0.01, 0.04),
    "clock": (1e-3, 1e-2),
    "in_motion": (0.5, 1.0),
    "bent_sensor": (8.0, 30.0),
    "play": (8.0, 30.0),
    "dead_band": (0.03, 0.1),
    "hum": (4.0, 12.0),
}
"""Troubles, in turn, and the range of their sizes, drawn evenly in its logarithm.

`one_trial`: one trial has so many times its friction more (a jammed cable chain).
`gain_drift`: the drive loses so large a share of its gain from trial to trial.
`clock`: the clock of the sensor's logger runs so large a share fast beside that of the commands.
`in_motion`: logs begin where the axis first has so large a share of its largest speed
    in the first half.
`bent_sensor`: the reading is too large by so many noises at both ends of the stroke (a square).
`play`: the sensor sits behind a gear whose play is so many noises wide; friction holds it.
`dead_band`: the drive takes so large a share of the peak force off every command.
`hum`: the reading hums at the mains' frequency with an amplitude of so many noises.
"""

IN_NOISES = ("bent_sensor", "play", "hum")
"""Troubles whose sizes are multiples of the sensor's noise."""


@dataclass(frozen=True)
class Trouble:
    """What is wrong.

    Attributes:
        name: one of `SIZES`, or "nothing".
        size: see there; of those `IN_NOISES` in the sensor's unit (m, rad).
        trial: from 0, of `one_trial`.
        mains: frequency of `hum` (Hz).
        phase: of `hum` in the first trial (rad).
    """

    name: str
    size: float = 0.0
    trial: int = 0
    mains: float = 0.0
    phase: float = 0.0


def _clocked(trouble: Trouble, rig: Rig, motion: Motion) -> Array:
    true = CubicHermiteSpline(motion.time, motion.q, motion.v)
    return np.asarray(true(motion.time / (1.0 + trouble.size)))


def _bent(trouble: Trouble, rig: Rig, motion: Motion) -> Array:
    return motion.q + trouble.size * (motion.q / rig.travel) ** 2


def _behind_play(trouble: Trouble, rig: Rig, motion: Motion) -> Array:
    half, place, shown = 0.5 * trouble.size, float(motion.q[0]), []
    for q in motion.q.tolist():
        place = min(max(place, q - half), q + half)
        shown.append(place)
    return np.array(shown)


def _humming(trouble: Trouble, rig: Rig, motion: Motion) -> Array:
    angle = 2.0 * math.pi * trouble.mains * motion.time + trouble.phase
    return motion.q + trouble.size * np.sin(angle)


SHOWN: dict[str, Callable[[Trouble, Rig, Motion], Array]] = {
    "clock": _clocked,
    "bent_sensor": _bent,
    "play": _behind_play,
    "hum": _humming,
}
"""Positions that a sensor shows besides its noise (m, rad), shape (rows,)."""


@dataclass(frozen=True)
class Laboratory:
    """One case.

    Attributes:
        campaign: rig, references, loop and sensor.
        friction: of the axis (N, N m).
        believed_friction: as the lab's model has it.
        presliding: distance in which the model's friction builds up (m, rad).
        trouble: what is wrong.
    """

    campaign: DrivenCampaign
    friction: float
    believed_friction: float
    presliding: float
    trouble: Trouble

    @cached_property
    def trials(self) -> list[tuple[Array, Array]]:
        """Commands (N, N m) and readings (m, rad) of each log."""
        return [self._trial(i) for i in range(TRIALS)]

    def _trial(self, i: int) -> tuple[Array, Array]:
        campaign, trouble = self.campaign, self.trouble
        motion, readings = campaign.run(self.effects(i), i)
        if trouble.name in SHOWN:
            shown = SHOWN[trouble.name](trouble, campaign.rig, motion)
            step = campaign.sensor.step
            readings = step * np.round((shown + campaign.noise(i)) / step)
        speeds = np.abs(motion.v)
        moving = speeds >= trouble.size * speeds[: len(speeds) // 2].max()
        first = int(moving.argmax()) if trouble.name == "in_motion" else 0
        return motion.command[first:], readings[first:]

    def effects(self, i: int) -> tuple[HiddenEffect, ...]:
        """What acts in trial i besides the rig."""
        name, size = self.trouble.name, self.trouble.size
        more = size if name == "one_trial" and i == self.trouble.trial else 0.0
        effects: list[HiddenEffect] = [CoulombFriction(self.friction * (1.0 + more))]
        if name == "gain_drift":
            effects.append(DriveGain(-size * i))
        if name == "dead_band":
            effects.append(DeadBand(size * self.campaign.rig.peak_force))
        return tuple(effects)

    def texts(self) -> dict[str, str]:
        """Texts of the lab's folder by name."""
        rig, sensor = self.campaign.rig, self.campaign.sensor
        command, position, factor = COLUMNS[rig.kind]
        sign = -1.0 if rig.kind == "slide" else 1.0
        limit = max(float(np.abs(forces).max()) for forces, _ in self.trials)
        tables = [
            {
                command: (sign * forces, files.digits(2.0 * limit / 2**16)),
                position: (factor * readings, files.digits(factor * sensor.step)),
            }
            for forces, readings in self.trials
        ]
        model = files.MODELS[rig.kind](self.campaign.believed, limit)
        model += files.friction(rig, self.believed_friction, self.presliding)
        return files.folder(rig.rate, tables, {}, model, {})

    def truth(self) -> dict[str, Any]:
        """What nobody must read before the diagnosis is made."""
        trouble, rate = self.trouble, self.campaign.rig.rate
        # A log at 50 to 120 Hz shows the mains at another frequency.
        seen = abs(trouble.mains - rate * round(trouble.mains / rate))
        named = {"trial": files.trial_name(trouble.trial), "seen_hz": seen}
        return self.campaign.truth() | {
            "trouble": vars(trouble) | named,
            "friction": {
                "true": self.friction,
                "believed": self.believed_friction,
                "presliding": self.presliding,
            },
        }


def draw(seed: int, number: int, block: str) -> tuple[dict[str, str], dict[str, Any]]:
    """Files of a case by name, and its truth; the same arguments give the same bits."""
    name = list(SIZES)[(number - 1) % len(SIZES)] if block == "lab" else "nothing"
    lab = laboratory(seed, number, name)
    texts = lab.texts()
    truth = {"block": block, "kind": name, "effects": [], "base_factors": {}}
    digest = hashlib.sha256(json.dumps(texts).encode()).hexdigest()[:16]
    return texts, truth | {"seed": seed, "number": number, "digest": digest} | lab.truth()


def laboratory(seed: int, number: int, name: str) -> Laboratory:
    """A case with a trouble, or "nothing".

    Of sixteen numbers in turn each trouble meets a slide and a joint, and of 32 both simulators.
    """
    rng, turn = np.random.default_rng((seed, number, 0x1AB)), number - 1
    kind = ("slide", "joint")[(turn + turn // len(SIZES)) % 2]
    simulator = ("own", "MuJoCo")[(turn // 2 + turn // (2 * len(SIZES))) % 2]
    rig = draw_joint(rng) if kind == "joint" else draw_slide(rng, springs=False)
    rig = replace(rig, rate=float(rng.choice([r for r in RATES if r >= 30.0 * rig.frequency][:2])))
    believed = replace(
        rig,
        inertia=rig.inertia * _off(rng),
        damping=rig.damping * _off(rng),
        stiffness=rig.stiffness * _off(rng),
        gravity=rig.gravity * _off(rng),
    )
    friction = rig.peak_force * log_uniform(rng, 0.05, 0.3)
    presliding = rig.travel * log_uniform(rng, 1e-4, 1e-3)
    rows = round(max(SHORTEST, PERIODS / rig.frequency) * rig.rate)
    references = [
        draw_reference(rng, rig.travel, rig.frequency, rig.rate, rows) for _ in range(TRIALS)
    ]
    white = rig.travel * log_uniform(rng, 1e-4, 1e-3)
    sensor = Sensor("encoder", white * rng.uniform(0.2, 1.0), Noise(white))
    bandwidth = min(rig.frequency * rng.uniform(1.5, 4.0), rig.rate / 25.0)
    known_friction = friction * _off(rng)
    moved = believed, sensor, references, {}, bandwidth, simulator, (seed, number)
    trouble = _trouble(np.random.default_rng((seed, number, 0x1AC)), name, sensor)
    return Laboratory(DrivenCampaign(rig, *moved), friction, known_friction, presliding, trouble)


def _trouble(rng: np.random.Generator, name: str, sensor: Sensor) -> Trouble:
    if name not in SIZES:
        return Trouble(name)
    size = log_uniform(rng, *SIZES[name]) * (sensor.rms if name in IN_NOISES else 1.0)
    trial, mains = int(rng.integers(TRIALS)), float(rng.choice((50.0, 60.0)))
    # The net is never at its nominal frequency.
    mains *= 1.0 + 4e-4 * rng.standard_normal()
    hum = (mains, rng.uniform(0.0, 2.0 * math.pi)) if name == "hum" else (0.0, 0.0)
    return Trouble(name, size, trial if name == "one_trial" else 0, *hum)


def _off(rng: np.random.Generator) -> float:
    return 1.0 + float(rng.choice((-1.0, 1.0)) * rng.uniform(*OFF))
