"""Friction with memory: LuGre's bristles, and elements that stick, stretch and slip (Maxwell)."""

import numpy as np

from benchmarks.hidden_effects.physics.effect import Hidden, Moment
from benchmarks.hidden_effects.physics.rig import Array


class Bristles:
    """LuGre (Canudas de Wit 1995): z' = v - |v| z / g(v), solved exactly over a step."""

    def __init__(self, presliding: float, breakaway: float, stribeck: float) -> None:
        """Take way to full friction (m), static over sliding friction, Stribeck's speed (m/s)."""
        self.presliding, self.breakaway, self.stribeck = presliding, breakaway, stribeck
        self.bent, self.ready = np.zeros(0), False

    def begin(self, lanes: int) -> None:
        """No bristle is bent."""
        self.bent, self.ready = np.zeros(lanes), True

    def deflect(self, speed: Array, step: float) -> Array:
        """Friction over sliding friction, after a step (s) at a speed (m/s)."""
        most = 1.0 + (self.breakaway - 1.0) * np.exp(-((speed / self.stribeck) ** 2))
        end = np.copysign(most, speed)
        keep = np.exp(-np.abs(speed) * (step / self.presliding) / most)
        self.bent = end + (self.bent - end) * keep
        return self.bent


class SlideFriction(Hidden):
    """Dry friction of the slide."""

    def __init__(
        self, force: Array, presliding: float, breakaway: float, stribeck: float, by_pressure: float
    ) -> None:
        """Take sliding friction (N) of all lanes; it grows with pressure (Pa) to a power."""
        self.sliding, self.by_pressure = force, by_pressure
        self.bristles = Bristles(presliding, breakaway, stribeck)

    def begin(self, moment: Moment) -> None:
        """Relax the bristles."""
        self.bristles.begin(len(moment.angle))

    def force(self, moment: Moment) -> Array:
        """Friction against the slide's motion."""
        grown = (moment.pressure / 350e3) ** self.by_pressure if self.by_pressure else 1.0
        return -self.sliding * grown * self.bristles.deflect(moment.velocity, moment.step)


class MaxwellSlip(Hidden):
    """Springs in parallel that slip one after the other: hysteresis without rate."""

    ELEMENTS = 7

    def __init__(self, force: Array, distance: float) -> None:
        """Take full force (N) of all lanes, and the way (m) over which a reversal settles."""
        self.scale = force
        knots = distance * np.geomspace(0.08, 2.0, self.ELEMENTS)
        heights = 1.0 - np.exp(-2.0 * knots / distance)
        heights /= heights[-1]
        slopes = np.diff(np.r_[0.0, heights]) / np.diff(np.r_[0.0, knots])
        self.springs = slopes - np.r_[slopes[1:], 0.0]
        self.distances = knots[:, None]
        self.stretched = np.zeros((self.ELEMENTS, 0))

    def begin(self, moment: Moment) -> None:
        """All elements relaxed."""
        self.stretched = np.zeros((self.ELEMENTS, len(moment.angle)))

    def force(self, moment: Moment) -> Array:
        """What the elements hold the slide back with."""
        moved = self.stretched + moment.step * moment.velocity
        self.stretched = np.clip(moved, -self.distances, self.distances)
        return -self.scale * (self.springs @ self.stretched)
