"""Hidden effects between the motor's command and the pull in the cable."""

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.physics.effect import Hidden, Moment
from benchmarks.hidden_effects.physics.friction import Bristles
from benchmarks.hidden_effects.physics.rig import Array


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
        self.time, self.held, self.before = time, np.zeros(0), np.zeros(0)

    def loads(self, loads: Array, step: float) -> Array:
        """A first-order filter of the loads, at rest under the first ones."""
        if step == 0.0:
            self.held, self.before = loads[0].copy(), loads[0].copy()
            return loads
        # Exact for a load that is linear between two times, whatever the lag.
        out = loads.copy()
        for i in np.flatnonzero(self.time > 1e-6):
            keep = float(np.exp(-step / self.time[i]))
            share = (1.0 - keep) * self.time[i] / step
            now, past = 1.0 - share, share - keep
            memory = [keep * self.held[i] + past * self.before[i]]
            out[:, i], _ = lfilter([now, past], [1.0, -keep], loads[:, i], zi=memory)
        self.held, self.before = out[-1].copy(), loads[-1].copy()
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
        speed = moment.rig["radius"] * moment.spin
        return -self.sliding * self.bristles.deflect(speed, moment.step)


class Slack(Hidden):
    """Cable (m) that hangs loose before it pulls."""

    def __init__(self, way: Array) -> None:
        """Take ways of all lanes."""
        self.way = way

    def slack(self) -> Array:
        """The way."""
        return self.way
