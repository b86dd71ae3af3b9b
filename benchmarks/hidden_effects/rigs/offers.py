"""Effects that a rig may hide, with their first and largest sizes."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.rigs import laws
from benchmarks.hidden_effects.rigs.imposed_rig import ImposedRig
from benchmarks.hidden_effects.rigs.laws import HiddenEffect
from benchmarks.hidden_effects.rigs.rig import Rig

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


def _free(rig: AnyRig) -> bool:
    return not rig.stiffness and not rig.gravity


def _coulomb(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    rise = rng.uniform(0.1, 0.5) if rng.random() < 0.5 else 0.0
    stribeck = rig.peak_speed * rng.uniform(0.02, 0.1)
    return laws.CoulombFriction(0.5 * rig.peak_force / (1.0 + rise), rise, stribeck)


def _by_position(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    slope = rng.choice((-1.0, 1.0)) * rng.uniform(0.4, 0.8) / rig.travel
    return laws.PositionFriction(0.3 * rig.peak_force, float(slope))


def _by_pressure(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    assert isinstance(rig, ImposedRig)
    slope = rng.uniform(0.5, 3.0) / max(rig.pressures)
    return laws.PressureFriction(0.3 * rig.peak_force, slope)


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
    "position_dependent_friction": Offer(_by_position),
    "constant_force": Offer(lambda rng, rig: laws.ConstantForce(0.5 * rig.peak_force)),
    "gravity": Offer(_gravity, lambda rig: rig.kind == "joint" and not rig.gravity),
    "spring": Offer(lambda rng, rig: laws.Spring(0.6 * rig.peak_force / rig.travel), _free),
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
    "channel_delay": Offer(lambda rng, rig: laws.ChannelDelay(_late(rig))),
    "backlash": Offer(lambda rng, rig: laws.Backlash(0.2 * rig.travel)),
}
"""By the catalogue's name."""


def _bumper(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    return laws.EndBumper(3.0 * rig.peak_force / rig.travel, rig.travel * rng.uniform(0.2, 0.5))


def _detent(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    place, width = rng.uniform(-0.4, 0.4), rng.uniform(0.05, 0.15)
    return laws.Detent(0.5 * rig.peak_force, rig.travel * place, rig.travel * width)


def _brake(rng: np.random.Generator, rig: AnyRig) -> HiddenEffect:
    place, width = rng.uniform(-0.5, 0.5), rng.uniform(0.1, 0.2)
    size = 1.5 * rig.peak_force / rig.peak_speed
    return laws.EddyBrake(size, rig.travel * place, rig.travel * width)


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
