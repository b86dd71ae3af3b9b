"""Hidden laws of force and friction, each with a size that can be scaled."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from benchmarks.hidden_effects.rigs.simulators.drive import Transmission


@dataclass(frozen=True)
class HiddenEffect:
    """One phenomenon that the lab's model lacks.

    Attributes:
        size: its main parameter, in the unit of the law (SI); 0 is absent.
    """

    size: float

    name: ClassVar[str]
    """That the catalogue has for it; a name of its own where the catalogue has none."""

    def force(self, q: float, v: float, u: float) -> float:
        """Force on the axis besides dry friction (N, N m), at position, speed and drive force."""
        return 0.0

    def kinetic(self, q: float, v: float, u: float) -> float:
        """Level of dry friction while it slips (N, N m), at least 0."""
        return 0.0

    def static(self, q: float, u: float) -> float:
        """Level at which it breaks away (N, N m)."""
        return self.kinetic(q, 0.0, u)

    def transmission(self, drive: Transmission) -> Transmission:
        """What it makes of the drive."""
        return drive

    def scaled(self, factor: float) -> Self:
        """The same, larger by a factor."""
        return replace(self, size=self.size * factor)

    def values(self) -> dict[str, float]:
        """Its parameters in SI."""
        return {key: value for key, value in vars(self).items() if isinstance(value, float)}


@dataclass(frozen=True)
class CoulombFriction(HiddenEffect):
    """Dry friction: kinetic level `size`, static level `size (1 + rise)`.

    Between them it falls as 1 / (1 + (v / stribeck)^2).
    """

    rise: float = 0.0
    stribeck: float = 1e-3
    name: ClassVar[str] = "coulomb_friction"

    def kinetic(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return self.size * (1.0 + self.rise / (1.0 + (v / self.stribeck) ** 2))


@dataclass(frozen=True)
class LoadFriction(HiddenEffect):
    """Dry friction that grows with the force of the drive, as in a gear: `size` is its share."""

    name: ClassVar[str] = "load_dependent_friction"

    def kinetic(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return self.size * abs(u)


@dataclass(frozen=True)
class PressureFriction(HiddenEffect):
    """Dry friction `size` without pressure that grows by `slope` of itself a pascal: a seal."""

    slope: float = 0.0
    name: ClassVar[str] = "pressure_dependent_friction"

    def kinetic(self, q: float, v: float, u: float) -> float:  # noqa: D102
        # An imposed motion has a pressure where a driven one has the force of its drive.
        return self.size * (1.0 + self.slope * u)


@dataclass(frozen=True)
class PositionFriction(HiddenEffect):
    """Dry friction `size` at q = 0 that grows by `slope` of itself a metre or radian."""

    slope: float = 0.0
    name: ClassVar[str] = "position_friction"

    def kinetic(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return self.size * max(1.0 + self.slope * q, 0.0)


@dataclass(frozen=True)
class Gravity(HiddenEffect):
    """m g l of a joint, which hangs at q = -angle."""

    angle: float = 0.0
    name: ClassVar[str] = "gravity"

    def force(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return -self.size * math.sin(q + self.angle)


@dataclass(frozen=True)
class Spring(HiddenEffect):
    """A spring about q = 0."""

    name: ClassVar[str] = "spring"

    def force(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return -self.size * q


@dataclass(frozen=True)
class HardeningSpring(HiddenEffect):
    """A force that grows with the cube of q."""

    name: ClassVar[str] = "hardening_spring"

    def force(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return -self.size * q**3


@dataclass(frozen=True)
class QuadraticDrag(HiddenEffect):
    """Drag with the square of speed."""

    name: ClassVar[str] = "quadratic_drag"

    def force(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return -self.size * v * abs(v)


@dataclass(frozen=True)
class DirectionalDamping(HiddenEffect):
    """More viscous friction towards positive q than towards negative."""

    name: ClassVar[str] = "directional_damping"

    def force(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return -self.size * max(v, 0.0)


@dataclass(frozen=True)
class Cogging(HiddenEffect):
    """A force that is periodic in position."""

    period: float = 1.0
    phase: float = 0.0
    name: ClassVar[str] = "cogging"

    def force(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return self.size * math.sin(2.0 * math.pi * q / self.period + self.phase)


@dataclass(frozen=True)
class DirectionalGain(HiddenEffect):
    """A drive that gives `size` of itself more forwards than backwards."""

    name: ClassVar[str] = "directional_gain"

    def transmission(self, drive: Transmission) -> Transmission:  # noqa: D102
        forward, backward = 1.0 + 0.5 * self.size, 1.0 - 0.5 * self.size
        return replace(drive, forward=forward, backward=backward)


@dataclass(frozen=True)
class DriveGain(HiddenEffect):
    """A drive that gives `size` of itself more than it says."""

    name: ClassVar[str] = "drive_gain"

    def transmission(self, drive: Transmission) -> Transmission:  # noqa: D102
        gain = 1.0 + self.size
        return replace(drive, forward=gain * drive.forward, backward=gain * drive.backward)


@dataclass(frozen=True)
class DeadBand(HiddenEffect):
    """A drive that gives nothing below a command of `size`, and so much less above it."""

    name: ClassVar[str] = "drive_dead_zone"

    def transmission(self, drive: Transmission) -> Transmission:  # noqa: D102
        return replace(drive, dead=self.size)


@dataclass(frozen=True)
class DriveDelay(HiddenEffect):
    """A force that comes `size` seconds late."""

    name: ClassVar[str] = "drive_delay"

    def transmission(self, drive: Transmission) -> Transmission:  # noqa: D102
        return replace(drive, delay=self.size)


@dataclass(frozen=True)
class DriveLag(HiddenEffect):
    """A force that follows its command with a time constant of `size` seconds."""

    name: ClassVar[str] = "drive_lag"

    def transmission(self, drive: Transmission) -> Transmission:  # noqa: D102
        return replace(drive, lag=self.size)


@dataclass(frozen=True)
class EndBumper(HiddenEffect):
    """Outside: a stiff pad that is touched beyond `at`, on one side only."""

    at: float = 0.0
    name: ClassVar[str] = "outside: bumper at one end"

    def force(self, q: float, v: float, u: float) -> float:  # noqa: D102
        return -self.size * max(q - self.at, 0.0)


@dataclass(frozen=True)
class Detent(HiddenEffect):
    """Outside: one magnetic notch at `at`, `width` wide."""

    at: float = 0.0
    width: float = 1.0
    name: ClassVar[str] = "outside: one detent"

    def force(self, q: float, v: float, u: float) -> float:  # noqa: D102
        place = (q - self.at) / self.width
        return -self.size * place * math.exp(0.5 - 0.5 * place * place)


@dataclass(frozen=True)
class EddyBrake(HiddenEffect):
    """Outside: a viscous brake that covers a part of the stroke, about `at`."""

    at: float = 0.0
    width: float = 1.0
    name: ClassVar[str] = "outside: brake on a part of the stroke"

    def force(self, q: float, v: float, u: float) -> float:  # noqa: D102
        place = (q - self.at) / self.width
        return -self.size * v * math.exp(-0.5 * place * place)


Force = Callable[[float, float, float], float]


def summed(
    effects: tuple[HiddenEffect, ...],
) -> tuple[Force, Force, Callable[[float, float], float]]:
    """Smooth force, kinetic and static level of dry friction of several effects together."""
    acting = [e.force for e in effects if type(e).force is not HiddenEffect.force]
    rubbing = [e for e in effects if type(e).kinetic is not HiddenEffect.kinetic]

    def force(q: float, v: float, u: float) -> float:
        return sum(each(q, v, u) for each in acting)

    def kinetic(q: float, v: float, u: float) -> float:
        return sum(each.kinetic(q, v, u) for each in rubbing)

    def static(q: float, u: float) -> float:
        return sum(each.static(q, u) for each in rubbing)

    return force, kinetic, static
