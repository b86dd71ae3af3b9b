"""Hidden effects between the motor's command and the pull in the cable."""

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.physics.muscle import Bristles
from benchmarks.hidden_effects.physics.rig import Array, Hidden, Moment

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
        return np.clip(rate, -self.limit, self.limit * np.sqrt(1.0 - beyond * beyond))


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
        size = np.abs(moment.asked - moment.pressure)
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
        growth = 2.0 * length / np.maximum(self.thread2 - length * length, 1e-6) - 1.0 / length
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


class DeadBand(Hidden):
    """Nothing up to a width (N); beyond it the load catches up by a slope."""

    def __init__(self, width: Array, slope: float) -> None:
        """Take widths of all lanes."""
        self.width, self.slope = width, slope

    def loads(self, loads: Array, step: float) -> Array:
        """The load, or what is left of it after the band, whichever is less."""
        return np.minimum(loads, np.maximum(self.slope * (loads - self.width), 0.0))


class CurrentLimit(Hidden):
    """The drive gives no more than a limit (N)."""

    def __init__(self, limit: Array) -> None:
        """Take limits of all lanes."""
        self.limit = limit

    def loads(self, loads: Array, step: float) -> Array:
        """The load, cut off."""
        return np.minimum(loads, self.limit)


class CurrentLag(Hidden):
    """The load follows by a time constant (s)."""

    def __init__(self, time: Array) -> None:
        """Take time constants of all lanes."""
        self.time, self.last_output, self.last_input = time, np.zeros(0), np.zeros(0)

    def loads(self, loads: Array, step: float) -> Array:
        """A first-order filter of the loads, at rest under the first ones."""
        if step == 0.0:
            self.last_output, self.last_input = loads[0].copy(), loads[0].copy()
            return loads
        # Exact for a load that is linear between two times, whatever the lag.
        out = loads.copy()
        for i in np.flatnonzero(self.time > 1e-6):
            keep = float(np.exp(-step / self.time[i]))
            share = (1.0 - keep) * self.time[i] / step
            now, past = 1.0 - share, share - keep
            out[:, i], _ = lfilter(
                [now, past],
                [1.0, -keep],
                loads[:, i],
                zi=[keep * self.last_output[i] + past * self.last_input[i]],
            )
        self.last_output, self.last_input = out[-1].copy(), loads[-1].copy()
        return out


class CommandDelay(Hidden):
    """The motor hears its command late (s)."""

    def __init__(self, delay: Array) -> None:
        """Take delays of all lanes."""
        self.delay = delay

    def motor_delay(self) -> Array:
        """The delay."""
        return self.delay


class Ripple(Hidden):
    """The motor's pull varies with its angle, by a share of itself."""

    def __init__(self, share: Array, periods: float, phase: float) -> None:
        """Take shares of all lanes, periods a turn, phase (rad)."""
        self.share, self.periods, self.phase = share, periods, phase

    def pull(self, moment: Moment) -> Array:
        """The part that varies."""
        return self.share * moment.load * np.cos(self.periods * moment.angle + self.phase)


class Imbalance(Hidden):
    """The motor's pull varies with where its shaft stands, the same at every pressure."""

    def __init__(self, share: Array, periods: float, phase: float) -> None:
        """Take shares of all lanes, periods a turn, phase (rad)."""
        self.share, self.periods, self.phase = share, periods, phase

    def pull(self, moment: Moment) -> Array:
        """The part that varies; the shaft is turned back by what the muscle has shortened."""
        shaft = moment.angle - moment.resting / moment.rig["radius"]
        return self.share * moment.load * np.cos(self.periods * shaft + self.phase)


class BearingFriction(Hidden):
    """Dry friction of the motor's bearing, which the load cell does not feel."""

    def __init__(self, force: Array, presliding: float) -> None:
        """Take forces (N at the pulley's radius) of all lanes, and way to full friction (m)."""
        self.sliding, self.bristles = force, Bristles(presliding, 1.0, 0.01)

    def begin(self, moment: Moment) -> None:
        """Relax the bristles."""
        self.bristles.begin(len(moment.angle))

    def pull(self, moment: Moment) -> Array:
        """Friction against the pulley's motion."""
        if not self.bristles.ready:
            return 0.0 * self.sliding
        return -self.sliding * self.bristles.deflect(
            moment.rig["radius"] * moment.spin, moment.step
        )


class Slack(Hidden):
    """Cable (m) that hangs loose before it pulls."""

    def __init__(self, way: Array) -> None:
        """Take ways of all lanes."""
        self.way = way

    def slack(self) -> Array:
        """The way."""
        return self.way
