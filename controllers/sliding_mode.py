"""Sliding mode control with a boundary layer and a disturbance observer."""

from typing import NamedTuple

import numpy as np

from controllers.design.designs import designed
from controllers.models.nominal_motion import NominalMotion
from controllers.observers.extended_state_observer import (
    ExtendedStateObserver,
    ObserverFeedback,
    Place,
)


class Settings(NamedTuple):
    """Settings of `SlidingMode`.

    Bandwidths are in units of 1 / reaction time (`ExtendedStateObserver.pole`).

    Attributes:
        layer_bandwidth: omega_s: how fast s dies out within the boundary layer, and the error on
            the surface.
        observer_bandwidth: omega_o: of the disturbance observer.
        switching: k (V): the most that switching adds to the equivalent control.
    """

    layer_bandwidth: float
    observer_bandwidth: float
    switching: float


BOUNDS = {
    "layer_bandwidth": (0.2, 3.0),
    "observer_bandwidth": (0.1, 2.0),
    "switching": (0.01, 2.0),
}
"""Between what a search looks for settings. With an observer of 3 the loop's largest sensitivity at
50 Hz with commands 20 ms late would be 5.8 where the muscle is stiffest, of 2 it is 2.6."""

DEFAULTS = {
    "displacement": Settings(1.2, 0.4, 0.05),
    "rotation": Settings(1.5, 0.35, 0.03),
    "contraction": Settings(1.2, 0.4, 0.05),
}
"""Settings by kind of task for what `controllers/design/designs.toml` does not give."""


class Surface(NamedTuple):
    """Sliding surface and control at a place of the stroke, on (x, d, d') or (x, x', d, d').

    Attributes:
        equivalent: gains of the equivalent control, d among it (V per m, V s per m, 1, s).
        switching: gains of s k / phi, which switching holds to +-k.
    """

    equivalent: np.ndarray
    switching: np.ndarray


class SlidingMode(ObserverFeedback[Settings]):
    """Drives the error to a surface s = 0, on which it decays, and holds it there.

    Near a place of the stroke the error e of the position against the nominal motion is that of one
    lag (motor) or two (regulator) behind a dead time (`LagDeadTimeModel`), x in what
    follows, in sampled form x(k+1) = A x(k) + b (v(k) + d(k)). The surface is s = c x, with

        c x = x,   or   c x = x' + omega_s x   with two lags: on it x dies out as exp(-omega_s t).

    The equivalent control keeps s as it is, s(k+1) = s(k), for the nominal model; the disturbance
    observer's d is what the model does not know, so that a constant mismatch leaves no offset; and
    switching drives s to 0 whatever is left of it:

        v = -d - d' T / 2 - c (A - 1) x / (c b) - k sat(s / phi)

    k has to exceed what the observer has not caught yet of d, not d itself. Within the layer of
    width phi the step of s is (1 - c b k / (phi s)) s, so

        phi = c b k / (1 - exp(-omega_s T))

    lets it die out as fast as a loop of this delay and noise can bear: with a narrower one the
    voltage chatters, for a sampled loop with dead time cannot stay nearer to s = 0. There the law
    is linear, and with one lag that of `ADRC`; beyond, the voltage goes against an error by k at
    most, however large it is, as while the rotor flies through the cable's slack.

    x and d are of when a voltage sent now begins to act, as the observer brings them forward with
    the voltages sent before. What is sent is held to 0-10 V, and the observer receives what was
    sent, so nothing winds up.

    Args:
        settings: settings to use instead of the designed ones.

    Example:
        >>> from controllers import SlidingMode
        >>> from pma_gym.envs import PMAEnv
        >>> env = PMAEnv("displacement", pressure_kpa=300.0, randomisation="varied")
        >>> env.reset(seed=4)
        (...)
        >>> controller, ended, info = SlidingMode(), False, {}
        >>> controller.reset(env.reference, env.station)
        >>> while not ended:
        ...     volts = controller.act(env.measurement, env.time)
        ...     *_, ended, info = env.step(env.action(volts))
        >>> bool(info["rmse_mm"] < 0.05)
        True

    Source:
        J.-J. E. Slotine and W. Li 1991, "Applied nonlinear control", chapter 7: surface, equivalent
        control, boundary layer. W. Gao, Y. Wang and A. Homaifa 1995, "Discrete-time variable
        structure control systems": the sampled form. J. Yang, S. Li and X. Yu 2013, "Sliding-mode
        control for systems with mismatched uncertainties via a disturbance observer": k smaller
        than the disturbance.
    """

    name = "sliding_mode"

    def _design(self, motion: NominalMotion) -> None:
        settings = self._fixed_settings or designed(self.name, motion.station, DEFAULTS)
        self._motion, self._most = motion, settings.switching
        self._observer = observer = ExtendedStateObserver(motion, settings.observer_bandwidth)
        poles = [observer.pole(place.lags, settings.layer_bandwidth) for place in observer.places]
        self._surfaces = [
            _surface(place, pole, motion.station.period)
            for place, pole in zip(observer.places, poles, strict=True)
        ]

    def _gains(self, at: int) -> np.ndarray:
        # Within the layer.
        return self._surfaces[at].equivalent + self._surfaces[at].switching

    def _unclipped_voltage(self, planned: float, z: np.ndarray) -> float:
        surface, most = self._surfaces[self._observer.at], self._most
        pushed = min(max(float(surface.switching @ z), -most), most)
        return planned - float(surface.equivalent @ z) - pushed


def _surface(place: Place, pole: float, period: float) -> Surface:
    """The surface at a place whose error dies out by the factor `pole` in a period."""
    n, equivalent = len(place.response), place.cancelled(period)
    c = np.array([1.0]) if n == 1 else np.array([-np.log(pole) / period, 1.0])
    reach = float(c @ place.response)
    equivalent[:n] = c @ (place.step[:n, :n] - np.eye(n)) / reach
    return Surface(equivalent, np.array([*((1.0 - pole) * c / reach), 0.0, 0.0]))
