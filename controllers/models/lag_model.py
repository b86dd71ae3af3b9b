"""Reduced model of the nominal plant near an operating point: one or two lags and a dead time.

A motor voltage moves the position mostly as one lag does (the muscle's, B / K), a regulator's
voltage as two (regulator, muscle). All that is faster - rotor against cable, sensor - only shifts
the response in time, and is one dead time theta with the loop's delays. In deviations from the
nominal motion

    e(t) = x(t - theta),   prod_i (tau_i d/dt + 1) x(t) = g (v(t) + d(t)),   d'' = 0

e is the position's error, v the voltage beside the feed-forward's, and d, in volts, all that the
nominal model does not know: Han's total disturbance. It has a slope, because on the way at constant
speed a muscle of another force needs a voltage that is off by a ramp; without one, a drawn station
at 150 kPa was 0.08 mm off all the way. With v held over control periods the sampled form is exact,
a dead time that is no whole number of periods included.

Source:
    S. Skogestad 2003, "Simple analytic rules for model reduction and PID controller tuning": small
    lags as dead time. J. Han 2009, "From PID to active disturbance rejection control": the
    disturbance as a state. R. Miklosovic, A. Radke and Z. Gao 2006, "Discrete implementation and
    generalization of the extended state observer": sampled form, slope of the disturbance.
"""

import math
from typing import NamedTuple

import numpy as np

from controllers.models.local_model import LocalModel

FASTEST = 0.37
"""Least share of a lag that is left after a control period: that of a lag of one period."""


class LagDeadTimeModel(NamedTuple):
    """One or two lags and a dead time at a place of the stroke.

    Attributes:
        gain: g (m/V or rad/V).
        constants: time constants tau (s), the slowest first.
        dead_time: theta of plant and sensor (s), without the loop's delays.
    """

    gain: float
    constants: tuple[float, ...]
    dead_time: float

    @property
    def rates(self) -> np.ndarray:
        """A in continuous time of (x, d, d') or (x, x', d, d'); v enters where d does."""
        n, product = len(self.constants), math.prod(self.constants)
        a = np.eye(n + 2, k=1)
        a[n - 1, :n] = -np.array([1.0, sum(self.constants)][:n]) / product
        a[n - 1, n] = self.gain / product
        return a


def lag_dead_time_model(local: LocalModel, period: float, order: int) -> LagDeadTimeModel:
    """A local model reduced to `order` lags; what is left of its mean delay is dead time.

    Args:
        local: sampled with the voltage held over each period.
        period: control period (s).
        order: 1 or 2.
    """
    inverse = np.linalg.inv(np.eye(len(local.b)) - local.a)
    # -G'(1) / G(1) is the mean of the impulse response in periods; holding adds half of one.
    delay = period * (float(local.c @ inverse @ inverse @ local.b) / local.gain - 0.5)
    moduli = np.sort(np.abs(np.linalg.eigvals(local.a)))[::-1]
    # A faster lag than that is gone when the next reading comes: nothing could be estimated of it.
    slowest = [-period / math.log(max(modulus, FASTEST)) for modulus in moduli[:order].tolist()]
    # Two poles that swing are slower by themselves than their response is.
    shrink = min(1.0, delay / sum(slowest))
    constants = tuple(max(shrink * lag, -period / math.log(FASTEST)) for lag in slowest)
    return LagDeadTimeModel(local.gain, constants, max(delay - sum(constants), 0.0))
