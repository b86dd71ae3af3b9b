"""Active disturbance rejection: estimate the total disturbance with an observer and cancel it."""

from typing import NamedTuple

import numpy as np

from controllers.design.designs import designed
from controllers.models.nominal_motion import NominalMotion
from controllers.models.voltage import nominal_offset
from controllers.observers.extended_state_observer import (
    ExtendedStateObserver,
    ObserverFeedback,
    Place,
)


class Settings(NamedTuple):
    """Settings of `ADRC`; bandwidths in units of 1 / reaction time (`ExtendedStateObserver.pole`).

    Attributes:
        controller_bandwidth: omega_c: of the error that is left once d is cancelled.
        observer_bandwidth: omega_o: of the estimate's error.
        feedforward: share of the nominal motion's voltage in the feed-forward; the rest of it is
            what the reference's speed alone asks for.
    """

    controller_bandwidth: float
    observer_bandwidth: float
    feedforward: float = 1.0


BOUNDS = {"controller_bandwidth": (0.2, 3.0), "observer_bandwidth": (0.1, 2.0)}
"""Between what a search looks for settings. With an observer of 3 the loop's largest sensitivity at
50 Hz with commands 20 ms late would be 5.8 where the muscle is stiffest, of 2 it is 2.6."""

DEFAULTS = {
    "displacement": Settings(0.8, 0.5),
    "rotation": Settings(0.6, 0.35),
    "contraction": Settings(0.5, 0.45),
}
"""Settings by kind of task for what `controllers/design/designs.toml` does not give."""


class ADRC(ObserverFeedback[Settings]):
    """Estimates and cancels the disturbance, then controls the known lag that remains.

    Near a place of the stroke the error e of the position against the nominal motion is that of one
    lag (motor) or two (regulator) behind a dead time (`LagDeadTimeModel`):

        prod_i (tau_i d/dt + 1) x = g (v + d),   d'' = 0,   e(t) = x(t - dead time)

    An extended state observer estimates z = (x, d, d') or (x, x', d, d') in its exact sampled form;
    all its poles lie at exp(-omega_o T). The estimate is of a time that lies back by the delays of
    command and reading and the small lags; with the voltages sent since it is brought forward to
    when a voltage sent now begins to act. There

        v = -K x - d - d' T / 2,   K such that all poles of x lie at exp(-omega_c T)

    on top of the feed-forward. What is sent is held to 0-10 V, and the observer receives what was
    sent, so nothing winds up.

    It departs from Han's form, x^(n) = f + b_0 v, in that the known lags are not left to f, and so
    are not to be estimated: at 10 to 40 ms of reaction against lags of 50 ms the observer would be
    too slow for them. b_0 = g / prod tau comes from the nominal model, by place and pressure. The
    disturbance has a slope, which a muscle of another force causes on the way at constant speed.

    The feed-forward is the nominal motion's voltage. With `feedforward=0` it is what the
    reference's speed asks for, (sum tau) r' / g, and the statics are part of d: on eight drawn
    stations at 100 Hz that left 0.051 mm of displacement instead of 0.026 mm.

    Args:
        settings: settings to use instead of the designed ones.

    Example:
        >>> from controllers import ADRC
        >>> from pma_gym.envs import PMAEnv
        >>> env = PMAEnv("displacement", pressure_kpa=300.0, randomisation="varied")
        >>> env.reset(seed=4)
        (...)
        >>> controller, ended, info = ADRC(), False, {}
        >>> controller.reset(env.reference, env.station)
        >>> while not ended:
        ...     volts = controller.act(env.measurement, env.time)
        ...     *_, ended, info = env.step(env.action(volts))
        >>> bool(info["rmse_mm"] < 0.05)
        True

    Source:
        J. Han 2009, "From PID to active disturbance rejection control", IEEE Transactions on
        Industrial Electronics 56(3). Z. Gao 2003, "Scaling and bandwidth-parameterization based
        controller tuning", American Control Conference. The dead time as in S. Zhao and Z. Gao
        2014, "Modified active disturbance rejection control for time-delay systems".
    """

    name = "adrc"

    def _design(self, motion: NominalMotion) -> None:
        settings = self._fixed_settings or designed(self.name, motion.station, DEFAULTS)
        self._motion, self._share = motion, settings.feedforward
        self._bandwidth = settings.controller_bandwidth
        self._offset = nominal_offset(motion.station)
        self._observer = ExtendedStateObserver(motion, settings.observer_bandwidth)
        self._feedback = [self._gains_of(place) for place in self._observer.places]

    def _gains_of(self, place: Place) -> np.ndarray:
        """Gains on z at a place: K on (x) or (x, x'), and what cancels d."""
        gains = place.cancelled(self._motion.station.period)
        pole = self._observer.pole(place.lags, self._bandwidth)
        gains[: self._observer.order] = place.feedback(pole)
        return gains

    def _gains(self, at: int) -> np.ndarray:
        return self._feedback[at]

    def _unclipped_voltage(self, planned: float, z: np.ndarray) -> float:
        return planned - float(self._feedback[self._observer.at] @ z)

    def _planned(self, time: float) -> float:
        whole = super()._planned(time)
        if self._share == 1.0:
            return whole
        station, lags = self._motion.station, self._observer.places[self._observer.at].lags
        begins = time + station.action_delay
        way = self._motion.planned(begins + station.period) - self._motion.planned(begins)
        moving = self._offset + sum(lags.constants) * way / (station.period * lags.gain)
        return self._share * whole + (1.0 - self._share) * moving
