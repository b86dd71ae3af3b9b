"""One case of block `rigs`: a rig, its references, what it hides, its logs and the truth."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.hidden_effects.rigs import effect_size, files, mujoco_axis, stick_slip
from benchmarks.hidden_effects.rigs.control import Controller
from benchmarks.hidden_effects.rigs.drive import Transmission
from benchmarks.hidden_effects.rigs.excitation import Reference, draw_lengths, draw_reference
from benchmarks.hidden_effects.rigs.laws import CoulombFriction, HiddenEffect
from benchmarks.hidden_effects.rigs.offers import KNOWN, OFFERS, OUTSIDE, group
from benchmarks.hidden_effects.rigs.rig import Rig, draw_joint, draw_slide, log_uniform
from benchmarks.hidden_effects.rigs.sensing import Sensed, Sensor, draw_sensor
from benchmarks.hidden_effects.rigs.stick_slip import Motion

KINDS = ("one effect", "nothing", "two effects", "one effect", "nothing", "outside")
"""Of what is hidden, in turn: of 600 cases 200 hide one, 200 none, 100 two, 100 what none has."""

SIMULATORS = {"own": stick_slip.simulate, "MuJoCo": mujoco_axis.simulate}
"""That cases take turns in."""

FAINT, STRONG = (0.5, 2.0), (2.0, 100.0)
"""Ranges of r, each of half of the effects."""

PILOT = 12.0
"""Seconds of the first file by which an effect's size is set."""

STEPS, NEAR, FAR = 8, 0.1, 1.5
"""Corrections of that size at most, how near r then should be, and by what factor it may miss."""

FARTHEST = 3.0
"""An open loop that leads farther than so many half strokes is closed."""

TRIES = 12
"""Draws of an effect until one is visible on a rig."""


@dataclass(frozen=True)
class Campaign:
    """What a lab does with one rig.

    Attributes:
        rig: the rig.
        believed: as its model has it.
        sensor: of its position.
        references: of its files.
        repeats: by number of a file, from 0, the earlier one that it repeats.
        bandwidth: of its loop (Hz); 0 where it is open.
        simulator: name of what computes it.
        seed: of the noise.
    """

    rig: Rig
    believed: Rig
    sensor: Sensor
    references: Sequence[Reference]
    repeats: Mapping[int, int]
    bandwidth: float
    simulator: str
    seed: Sequence[int]


@dataclass(frozen=True)
class Run:
    """One file: the true motion and what was logged.

    Attributes:
        motion: the true one.
        exact: what the sensor would read without noise (m, rad).
        log: what the file has.
    """

    motion: Motion
    exact: np.ndarray
    log: files.Log


def draw(seed: int, number: int) -> tuple[dict[str, str], dict[str, Any]]:
    """Files of a case by name, and its truth; the same seed and number give the same bits."""
    rng = np.random.default_rng((seed, number, 0x51D5))
    rigs = tuple(KNOWN)
    turn = number - 1
    kind = KINDS[turn // len(rigs) % len(KINDS)]
    simulator = tuple(SIMULATORS)[turn // (len(rigs) * len(KINDS)) % len(SIMULATORS)]
    campaign = _campaign(rng, rigs[turn % len(rigs)], simulator, (seed, number))
    effects, campaign = _hidden(rng, kind, campaign)
    runs = [run(campaign, effects, i) for i in range(len(campaign.references))]
    sizes = [_ratio(campaign, (each,)) for each in effects]
    texts = files.contents(
        campaign.rig,
        campaign.believed,
        [each.log for each in runs],
        campaign.repeats,
        campaign.sensor.step,
        campaign.sensor.rms,
    )
    return texts, _truth(kind, campaign, effects, sizes) | {"seed": seed, "number": number}


def run(
    campaign: Campaign, effects: tuple[HiddenEffect, ...], i: int, seconds: float = math.inf
) -> Run:
    """File i of a campaign, or its first seconds."""
    rig, reference = campaign.rig, campaign.references[i]
    rows = int(min(len(reference.q), seconds * rig.rate))
    rng = np.random.default_rng((*campaign.seed, i, 7))
    noise = campaign.sensor.noise.draw(rng, np.arange(len(reference.q)) / rig.rate)
    between = [r for r in (each.reading() for each in effects) if r is not None]
    sensed = Sensed(campaign.sensor, noise, between, 1.0 / rig.rate)
    # A drive that is off moves nothing only where nothing else does.
    released = not rig.gravity and not any(each.force(0.0, 0.0, 0.0) for each in effects)
    controller = Controller(campaign.believed, reference, sensed, campaign.bandwidth, released)
    transmission = Transmission()
    for each in effects:
        transmission = each.transmission(transmission)
    start = (float(reference.q[0]), 0.0)
    simulate = SIMULATORS[campaign.simulator]
    motion = simulate(rig, effects, transmission, controller, rows, start)
    controller.end(float(motion.q[-1]))
    log = files.Log(motion.command, np.array(controller.readings))
    return Run(motion, np.array(sensed.exact), log)


def _campaign(
    rng: np.random.Generator, kind: str, simulator: str, seed: tuple[int, int]
) -> Campaign:
    rig = draw_joint(rng) if kind == "joint" else draw_slide(rng, springs=False)
    believed = replace(
        rig,
        inertia=rig.inertia * rng.uniform(0.9, 1.1),
        damping=rig.damping * rng.uniform(0.85, 1.15),
        stiffness=rig.stiffness * rng.uniform(0.93, 1.07),
        gravity=rig.gravity * rng.uniform(0.93, 1.07),
    )
    held = bool(rig.stiffness or rig.gravity)
    opened = rng.random() < (0.5 if held else 0.15)
    bandwidth = 0.0 if opened else min(rig.frequency * rng.uniform(1.5, 4.0), rig.rate / 25.0)
    lengths = draw_lengths(rng, rig)
    if opened and not held:
        lengths = [max(5.0, min(8.0, each)) for each in lengths]
    rows = [round(each * rig.rate) for each in lengths]
    references = [draw_reference(rng, rig, each) for each in rows]
    repeats = {}
    if opened and rng.random() < 0.85:
        references[1], repeats = references[0], {1: 0}
    sensor = draw_sensor(rng, rig)
    return Campaign(rig, believed, sensor, references, repeats, bandwidth, simulator, seed)


def _hidden(
    rng: np.random.Generator, kind: str, campaign: Campaign
) -> tuple[tuple[HiddenEffect, ...], Campaign]:
    """What a case hides, each effect at its own r, and the campaign, whose loop may be closed."""
    chosen: list[HiddenEffect] = []
    count = {"nothing": 0, "two effects": 2}.get(kind, 1)
    for _ in range(TRIES):
        if len(chosen) == count:
            break
        if kind == "outside":
            offer = OUTSIDE[int(rng.integers(len(OUTSIDE)))]
        else:
            names = [
                n for n in KNOWN[campaign.rig.kind] if not any(n in group(c.name) for c in chosen)
            ]
            offer = OFFERS[str(rng.choice(names))]
        if not offer.fits(campaign.rig):
            continue
        most = offer.draw(rng, campaign.rig)
        low, high = FAINT if rng.random() < 0.5 else STRONG
        effect = _sized(campaign, most, log_uniform(rng, low, high))
        if effect is not None:
            chosen.append(effect)
    effects = tuple(chosen)
    if not campaign.bandwidth:
        far = max(
            np.abs(run(campaign, effects, i).motion.q).max()
            for i in range(len(campaign.references))
        )
        if far > FARTHEST * campaign.rig.travel:
            closed = replace(campaign, bandwidth=2.0 * campaign.rig.frequency, repeats={})
            return effects, closed
    return effects, campaign


def _sized(campaign: Campaign, most: HiddenEffect, wanted: float) -> HiddenEffect | None:
    """An effect at some r, or as large as it may be; None where that is not visible."""
    share, ratio, scaled = 0.2, 0.0, most
    for _ in range(STEPS):
        scaled = most.scaled(share)
        ratio = _ratio(campaign, (scaled,))
        if abs(ratio / wanted - 1.0) < NEAR or (share == 1.0 and ratio < wanted):
            break
        share = min(1.0, share * min(max(wanted / max(ratio, 1e-9), 0.02), 20.0))
    return scaled if FAINT[0] * (1.0 - NEAR) <= ratio <= FAR * wanted else None


def _ratio(campaign: Campaign, effects: tuple[HiddenEffect, ...]) -> float:
    """Size r by the beginning of the first file."""
    pilot = run(campaign, effects, 0, PILOT + 2.0 / campaign.rig.frequency)
    changed = effect_size.change(campaign.rig, [pilot.motion], [pilot.exact])
    return effect_size.size(changed, campaign.sensor.rms)


def _truth(
    kind: str, campaign: Campaign, effects: Sequence[HiddenEffect], sizes: Sequence[float]
) -> dict[str, Any]:
    rig, believed = campaign.rig, campaign.believed
    factor = files.COLUMNS[rig.kind][2]
    return {
        "block": "rigs",
        "kind": kind,
        "effects": [
            {
                "name": each.name,
                "group": group(each.name),
                "parameters": each.values(),
                "expected": expected(rig, each),
                "r": ratio,
            }
            for each, ratio in zip(effects, sizes, strict=True)
        ],
        "base_factors": {},
        "simulator": campaign.simulator,
        "rig": vars(rig),
        "believed": vars(believed),
        "loop_hz": campaign.bandwidth,
        "seconds": [len(each.q) / rig.rate for each in campaign.references],
        "sensor": {"kind": campaign.sensor.kind, "step": campaign.sensor.step * factor},
        "noise": {files.COLUMNS[rig.kind][1]: campaign.sensor.rms * factor},
        "noise_kinds": campaign.sensor.noise.names,
    }


def expected(rig: Rig, effect: HiddenEffect) -> dict[str, float]:
    """Values in file units, by the catalogue's parameter, that describe a hidden effect."""
    del rig
    if isinstance(effect, CoulombFriction):
        return {"dynamic_n": effect.size}
    return {
        "drive_delay": {"delay_ms": 1e3 * effect.size},
        "drive_lag": {"time_constant_ms": 1e3 * effect.size},
    }.get(effect.name, {})
