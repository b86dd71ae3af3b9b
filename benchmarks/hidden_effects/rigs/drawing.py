"""One case of block `rigs`: a rig, what it hides, the lab's folder and the truth.

Effects that a rig may hide, with their first and largest sizes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.hidden_effects.rigs import laws
from benchmarks.hidden_effects.rigs.driven_campaign import DrivenCampaign, draw_driven
from benchmarks.hidden_effects.rigs.imposed_campaign import ImposedCampaign, draw_tested
from benchmarks.hidden_effects.rigs.laws import HiddenEffect
from benchmarks.hidden_effects.rigs.rig import ImposedRig, Rig, log_uniform

AnyRig = Rig | ImposedRig
"""Of either kind."""

Draw = Callable[[np.random.Generator, AnyRig], HiddenEffect]


@dataclass(frozen=True)
class Offer:
    """One effect.

    Attributes:
        draw: one as large as it may be, its shape by chance.
        fits: whether a rig can hide it.
    """

    draw: Draw
    fits: Callable[[AnyRig], bool] = lambda rig: True


def _coulomb(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    rise = rng.uniform(0.1, 0.5) if rng.random() < 0.5 else 0.0
    stribeck = rig.peak_speed * rng.uniform(0.02, 0.1)
    return laws.CoulombFriction(0.5 * rig.peak_force / (1.0 + rise), rise, stribeck)


def _by_pressure(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    assert isinstance(rig, ImposedRig)
    return laws.PressureFriction(0.3 * rig.peak_force, rng.uniform(0.5, 3.0) / max(rig.pressures))


def _cogging(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    period = rig.travel * rng.uniform(0.15, 0.6)
    return laws.Cogging(0.3 * rig.peak_force, period, rng.uniform(0.0, 2.0 * math.pi))


def _gravity(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    return laws.Gravity(0.8 * rig.peak_force, rng.uniform(-0.4, 0.4))


def _late(rig: AnyRig) -> float:
    """A fortieth of the fastest period (s): loops of four times that frequency bear it."""
    return 1.0 / (40.0 * rig.frequency)


OFFERS: dict[str, Offer] = {
    "coulomb_friction": Offer(_coulomb),
    "load_dependent_friction": Offer(lambda rng, rig: laws.LoadFriction(0.5)),
    "pressure_dependent_friction": Offer(
        _by_pressure, lambda rig: isinstance(rig, ImposedRig) and rig.area > 0.0
    ),
    "gravity": Offer(_gravity, lambda rig: rig.kind == "joint" and not rig.gravity),
    "spring": Offer(
        lambda rng, rig: laws.Spring(0.6 * rig.peak_force / rig.travel),
        lambda rig: not rig.stiffness and not rig.gravity,
    ),
    "hardening_spring": Offer(
        lambda rng, rig: laws.HardeningSpring(0.6 * rig.peak_force / rig.travel**3)
    ),
    "quadratic_drag": Offer(
        lambda rng, rig: laws.QuadraticDrag(0.6 * rig.peak_force / rig.peak_speed**2)
    ),
    "directional_damping": Offer(
        lambda rng, rig: laws.DirectionalDamping(0.6 * rig.peak_force / rig.peak_speed)
    ),
    "cogging": Offer(_cogging),
    "directional_gain": Offer(lambda rng, rig: laws.DirectionalGain(0.2)),
    "drive_delay": Offer(lambda rng, rig: laws.DriveDelay(_late(rig))),
    "drive_lag": Offer(lambda rng, rig: laws.DriveLag(_late(rig))),
}
"""By the catalogue's name."""


def _bumper(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    return laws.EndBumper(3.0 * rig.peak_force / rig.travel, rig.travel * rng.uniform(0.2, 0.5))


def _detent(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    place, width = rng.uniform(-0.4, 0.4), rng.uniform(0.05, 0.15)
    return laws.Detent(0.5 * rig.peak_force, rig.travel * place, rig.travel * width)


def _brake(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    place, width = rng.uniform(-0.5, 0.5), rng.uniform(0.1, 0.2)
    return laws.EddyBrake(
        1.5 * rig.peak_force / rig.peak_speed, rig.travel * place, rig.travel * width
    )


OUTSIDE: tuple[Offer, ...] = (Offer(_bumper), Offer(_detent), Offer(_brake))
"""What no catalogue has."""

KNOWN: dict[str, tuple[str, ...]] = {
    "slide": (
        "coulomb_friction",
        "load_dependent_friction",
        "quadratic_drag",
        "directional_damping",
        "directional_gain",
        "drive_delay",
        "drive_lag",
    ),
    "joint": (
        "coulomb_friction",
        "load_dependent_friction",
        "gravity",
        "spring",
        "hardening_spring",
        "quadratic_drag",
        "directional_damping",
        "directional_gain",
        "drive_delay",
        "drive_lag",
    ),
    "imposed": (
        "coulomb_friction",
        "pressure_dependent_friction",
        "hardening_spring",
        "quadratic_drag",
        "directional_damping",
        "cogging",
    ),
}
"""What the catalogue has for each kind of rig."""

JOINT_NAMES: dict[str, str] = {
    "coulomb_friction": "joint_friction",
    "load_dependent_friction": "joint_load_friction",
    "gravity": "joint_weight",
    "spring": "joint_spring",
    "hardening_spring": "joint_hardening_spring",
    "quadratic_drag": "joint_drag",
    "directional_damping": "joint_directional_damping",
}
"""What the catalogue calls effects of a joint, where a slide's has another name there."""


IMPOSED_NAMES: dict[str, str] = {
    "coulomb_friction": "contact_friction",
    "pressure_dependent_friction": "pressure_friction",
}
"""The same of a part on a testing machine."""

NAMES: dict[str, dict[str, str]] = {"joint": JOINT_NAMES, "imposed": IMPOSED_NAMES}
"""By kind of rig."""


def catalogue_name(kind: str, name: str) -> str:
    """Name that the catalogue has for an effect of a kind of rig."""
    return NAMES.get(kind, {}).get(name, name)


GROUPS: tuple[frozenset[str], ...] = (
    frozenset(
        {"drive_delay", "drive_lag", "lvdt_lag", "lvdt_delay", "encoder_lag", "encoder_delay"}
    ),
    frozenset({"coulomb_friction", "load_dependent_friction", "position_dependent_friction"}),
    frozenset({"joint_friction", "joint_load_friction"}),
    frozenset({"contact_friction", "pressure_friction"}),
    frozenset({"joint_weight", "joint_spring", "joint_hardening_spring"}),
)
"""Effects that usual logs cannot always tell apart; fixed before any held-out seed is run."""


def group(name: str) -> tuple[str, ...]:
    """The effects that one may be taken for, itself first."""
    others = next((names for names in GROUPS if name in names), frozenset())
    return (name, *sorted(others - {name}))


KINDS = ("one effect", "nothing", "two effects", "one effect", "nothing", "outside")
"""Of what is hidden, in turn: of 600 cases 200 hide one, 200 none, 100 two, 100 what none has."""

SIMULATORS = ("own", "MuJoCo")
"""That cases take turns in."""

FAINT, STRONG = (0.5, 2.0), (2.0, 100.0)
"""Ranges of r, each of half of the effects."""

STEPS, NEAR, FAR = 8, 0.1, 1.5
"""Corrections of a size at most, how near r then should be, and by what factor it may miss."""

TRIES = 12
"""Draws of an effect until one is visible on a rig."""


Campaign = DrivenCampaign | ImposedCampaign
"""One rig and what a lab logs of it."""

DRAWN = {"slide": draw_driven, "joint": draw_driven, "imposed": draw_tested}
"""How campaigns of each kind of rig are drawn."""


def drawn(seed: int, number: int) -> tuple[Campaign, list[HiddenEffect]]:
    """Rig of a case, and what it hides; the same seed and number give the same bits."""
    rng = np.random.default_rng((seed, number, 0x51D5))
    rig, kind, simulator = turn_of(number)
    campaign: Campaign = DRAWN[rig](rng, rig, simulator, (seed, number))
    effects = _hidden(rng, kind, campaign)
    return campaign.within_range(effects), effects


def draw(seed: int, number: int) -> tuple[dict[str, str], dict[str, Any]]:
    """Files of a case by name, and its truth."""
    campaign, effects = drawn(seed, number)
    truth = {
        "block": "rigs",
        "kind": turn_of(number)[1],
        "effects": [_described(campaign, each) for each in effects],
        "base_factors": {},
        "seed": seed,
        "number": number,
    }
    return campaign.texts(effects), truth | campaign.truth()


def turn_of(number: int) -> tuple[str, str, str]:
    """Rig, kind and simulator of a case; each changes when the one before has come round."""
    rigs, turn = tuple(KNOWN), number - 1
    turn, rig = divmod(turn, len(rigs))
    turn, kind = divmod(turn, len(KINDS))
    return rigs[rig], KINDS[kind], SIMULATORS[turn % len(SIMULATORS)]


def _hidden(rng: np.random.Generator, kind: str, campaign: Campaign) -> list[HiddenEffect]:
    """What a case hides, each effect at its own r."""
    chosen: list[HiddenEffect] = []
    count = {"nothing": 0, "two effects": 2}.get(kind, 1)
    for _ in range(TRIES):
        if len(chosen) == count:
            break
        if kind == "outside":
            offer = OUTSIDE[int(rng.integers(len(OUTSIDE)))]
        else:
            taken = {name for each in chosen for name in group(each.name)}
            names = [name for name in KNOWN[campaign.rig.kind] if name not in taken]
            offer = OFFERS[str(rng.choice(names))]
        low, high = FAINT if rng.random() < 0.5 else STRONG
        target = log_uniform(rng, low, high)
        if offer.fits(campaign.rig):
            effect = _sized(campaign, offer.draw(rng, campaign.rig), target)
            chosen += [effect] if effect is not None else []
    return chosen


def _sized(campaign: Campaign, most: HiddenEffect, target: float) -> HiddenEffect | None:
    """An effect at some r, or as large as it may be; None where that is not visible."""
    share, ratio, scaled = 0.2, 0.0, most
    for _ in range(STEPS):
        scaled = most.scaled(share)
        ratio = campaign.ratio(scaled)
        if abs(ratio / target - 1.0) < NEAR or (share == 1.0 and ratio < target):
            break
        share = min(1.0, share * min(max(target / max(ratio, 1e-9), 0.02), 20.0))
    return scaled if FAINT[0] * (1.0 - NEAR) <= ratio <= FAR * target else None


def _described(campaign: Campaign, effect: HiddenEffect) -> dict[str, Any]:
    name = catalogue_name(campaign.rig.kind, effect.name)
    return {
        "name": name,
        "group": group(name),
        "parameters": effect.values(),
        "r": campaign.ratio(effect),
    }
