"""Hidden effects between the regulator's command and the air in the muscle."""

import numpy as np

from benchmarks.hidden_effects.physics.effect import Hidden, Moment
from benchmarks.hidden_effects.physics.rig import Array

ATMOSPHERE = 101325.0
SUPPLY = 1000e3
"""Gauge pressure (Pa) of the supply."""

CRITICAL = 0.4
"""Pressure ratio under which a valve's flow is choked."""


class SlowVent(Hidden):
    """Venting takes longer than filling, by a ratio."""

    def __init__(self, ratio: Array) -> None:
        """Take ratios of all lanes."""
        self.ratio = ratio

    def flow(self, rate: Array, moment: Moment) -> Array:
        """The rate, slower where it is negative."""
        return np.where(rate < 0.0, rate / self.ratio, rate)


class NarrowValve(Hidden):
    """A valve that is fully open passes so much (Pa/s); filling chokes by ISO 6358's ellipse."""

    def __init__(self, limit: Array) -> None:
        """Take limits of all lanes."""
        self.limit = limit

    def flow(self, rate: Array, moment: Moment) -> Array:
        """The rate, held."""
        ratio = (moment.pressure + ATMOSPHERE) / (SUPPLY + ATMOSPHERE)
        beyond = np.clip((ratio - CRITICAL) / (1.0 - CRITICAL), 0.0, 1.0)
        filling = self.limit * np.sqrt(1.0 - beyond * beyond)
        return np.clip(rate, -self.limit, filling)


class LateValve(Hidden):
    """The regulator hears its command late (s)."""

    def __init__(self, delay: Array) -> None:
        """Take delays of all lanes."""
        self.delay = delay

    def regulator_delay(self) -> Array:
        """The delay."""
        return self.delay


class LazyValve(Hidden):
    """The valve stays shut while the pressure is wrong by less than a width (Pa)."""

    def __init__(self, width: Array) -> None:
        """Take widths of all lanes."""
        self.width = width

    def flow(self, rate: Array, moment: Moment) -> Array:
        """The rate of what is wrong beyond the width."""
        error = moment.asked - moment.pressure
        size = np.abs(error)
        return rate * np.maximum(size - self.width, 0.0) / np.maximum(size, 1e-6)


class Squeeze(Hidden):
    """Air is squeezed as the muscle is pulled: polytropic, by the volume inside a braid."""

    def __init__(self, exponent: Array, length: float, diameter: float, turns: float) -> None:
        """Take exponents of all lanes; resting length and diameter (m), turns of a thread."""
        self.exponent, self.length = exponent, length
        self.thread2 = length**2 + (np.pi * turns * diameter) ** 2

    def chamber(self, moment: Moment) -> Array:
        """Rate of the pressure from the rate of ln V, V as length times width squared."""
        length = self.length - moment.contraction
        width2 = np.maximum(self.thread2 - length * length, 1e-6)
        growth = 2.0 * length / width2 - 1.0 / length
        return -self.exponent * (moment.pressure + ATMOSPHERE) * growth * moment.velocity


class OpeningLeak(Hidden):
    """Air escapes in proportion to the absolute pressure, through a leak that opens in a trial.

    A leak that is the same at all times changes a regulator of first order into another one of
    first order; one that opens as its seal gives way does not.
    """

    def __init__(self, rate: Array, opening: float) -> None:
        """Take rates (1/s) of all lanes, and the time constant (s) with which the leak opens."""
        self.rate, self.opening, self.time = rate, opening, 0.0

    def begin(self, moment: Moment) -> None:
        """Close the leak."""
        self.time = 0.0

    def chamber(self, moment: Moment) -> Array:
        """Rate of the pressure by the air that escapes."""
        self.time += moment.step
        opened = -np.expm1(-self.time / self.opening)
        return -self.rate * opened * (moment.pressure + ATMOSPHERE)
