"""Hidden effects of a muscle beyond spring and damper."""

import numpy as np
from scipy.interpolate import PchipInterpolator

from benchmarks.hidden_effects.physics.effect import Hidden, Moment
from benchmarks.hidden_effects.physics.rig import Array

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
        percent = -moment.contraction * (100.0 / LENGTH)
        return self.factor * np.interp(percent, self.AT, self.FORCE)


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
        self.given = np.zeros(0)

    def begin(self, moment: Moment) -> None:
        """All dashpots have given way to where the muscle rests."""
        self.given = np.repeat(moment.contraction[None, :], len(self.times), axis=0)

    def force(self, moment: Moment) -> Array:
        """Force of the springs that the dashpots have not yet relieved."""
        self.given = self.given + moment.step * (moment.contraction - self.given) / self.times
        return -self.spring * (moment.contraction - self.given.mean(axis=0))


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
