"""Hidden effects of a muscle beyond spring and damper."""

import numpy as np
from scipy.interpolate import PchipInterpolator

from benchmarks.hidden_effects.physics.rig import Array, Hidden, Moment


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
        self.stretched = np.clip(
            self.stretched + moment.step * moment.velocity, -self.distances, self.distances
        )
        return -self.scale * (self.springs @ self.stretched)


LENGTH = 0.25
"""Resting length (m)."""


class BentSpring(Hidden):
    """A spring that stiffens or softens exponentially as the muscle contracts.

    F = -REFERENCE L0 curvature (exp(growth u) - 1 - growth u) / growth^2,   u = x / L0
    """

    static = True
    REFERENCE = 20e3

    def __init__(self, curvature: Array, growth: float) -> None:
        """Take curvatures of all lanes, and by how much they grow over a length."""
        self.curvature, self.growth = curvature, growth

    def force(self, moment: Moment) -> Array:
        """Force beside the straight spring's."""
        grown = self.growth * moment.contraction / LENGTH
        bent = (np.expm1(grown) - grown) / self.growth**2
        return -self.REFERENCE * LENGTH * self.curvature * bent


class Overstretch(Hidden):
    """Bladder and braid resist being longer than at rest, by a table of forces."""

    static = True

    TABLE = PchipInterpolator(
        np.array([0.0, 1.0, 2.0, 3.0, 4.0, 6.0]), np.array([0.0, 96.0, 229.0, 416.0, 684.0, 1430.0])
    )
    AT = np.linspace(0.0, 6.0, 601)
    FORCE = TABLE(AT)

    def __init__(self, factor: Array) -> None:
        """Take factors of all lanes."""
        self.factor = factor

    def force(self, moment: Moment) -> Array:
        """Force at a contraction."""
        return self.factor * np.interp(-moment.contraction * (100.0 / LENGTH), self.AT, self.FORCE)


class LoadedDamping(Hidden):
    """Damping is larger at middle load."""

    def __init__(self, linear: Array, quadratic: Array) -> None:
        """Take factors of load over contractile force, and of its square, of all lanes."""
        self.linear, self.quadratic = linear, quadratic

    def damping(self, moment: Moment) -> Array:
        """Factor on the damping."""
        share = np.clip(moment.tension / (2.91e-3 * moment.pressure + 44.6), 0.0, 1.0)
        return np.maximum(1.0 + share * (self.linear + self.quadratic * share), 0.0)


class Dashpots(Hidden):
    """Dashpots, each behind a spring, beside the muscle; they give way with time."""

    def __init__(self, spring: Array, times: tuple[float, ...]) -> None:
        """Take stiffness (N/m) of all lanes, shared by branches of these time constants (s)."""
        self.spring, self.times = spring, np.array(times)[:, None]
        self.positions = np.zeros(0)

    def begin(self, moment: Moment) -> None:
        """All dashpots have given way to where the muscle rests."""
        self.positions = np.repeat(moment.contraction[None, :], len(self.times), axis=0)

    def force(self, moment: Moment) -> Array:
        """Force of the springs that the dashpots have not yet relieved."""
        self.positions = (
            self.positions + moment.step * (moment.contraction - self.positions) / self.times
        )
        return -self.spring * (moment.contraction - self.positions.mean(axis=0))


class WarmUp(Hidden):
    """A rested muscle pulls harder, the more the lower the pressure; it halves with the trials."""

    static = True
    REFERENCE, POWER = 200e3, -3.0

    def __init__(self, force: Array, half_life: float) -> None:
        """Take forces (N) at 200 kPa in the first trial of all lanes, and trials to half of it."""
        self.first, self.half_life = force, half_life

    def force(self, moment: Moment) -> Array:
        """What is left of it."""
        left = self.first * 0.5 ** (moment.order / self.half_life)
        return left * (moment.pressure / self.REFERENCE) ** self.POWER
