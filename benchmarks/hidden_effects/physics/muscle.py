"""What a muscle does that a spring and a damper do not."""

import numpy as np
from scipy.interpolate import PchipInterpolator

from benchmarks.hidden_effects.physics.effect import Hidden, Moment
from benchmarks.hidden_effects.physics.rig import Array, stiffness

LENGTH = 0.25
"""Resting length (m)."""


class BentSpring(Hidden):
    """The spring stiffens or softens with contraction."""

    static = True

    def __init__(self, first: Array, second: Array) -> None:
        """Take relative change of the stiffness by share of length, and by its square."""
        self.first, self.second = first, second

    def force(self, moment: Moment) -> Array:
        """Force beside the straight spring's."""
        share = moment.contraction / LENGTH
        straight = stiffness(moment.pressure, moment.rig) * moment.contraction
        return -straight * share * (self.first + self.second * share)


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
    """A cold muscle is softer by a share, which fades with every trial."""

    static = True

    def __init__(self, share: Array, trials: float) -> None:
        """Take shares of all lanes, and trials after which 1/e is left."""
        self.share, self.trials = share, trials

    def force(self, moment: Moment) -> Array:
        """What the spring lacks."""
        left = self.share * np.exp(-moment.order / self.trials)
        return left * stiffness(moment.pressure, moment.rig) * moment.contraction
