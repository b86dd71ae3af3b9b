"""An extended state observer on the lag and dead-time model of the nominal plant.

Reduced model of the nominal plant near an operating point: one or two lags and a dead time.

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

Common part of controllers on a lag observer: the voltage they send, and their linear law.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import expm

from controllers.models.nominal_motion import NominalMotion
from pma_gym.envs import Measurement

if TYPE_CHECKING:
    import control
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Generic, TypeVar

from controllers.models.local_model import LocalModel
from controllers.models.nominal_motion import nominal_motion
from controllers.models.voltage import VOLTAGE_LIMIT
from controllers.registry import Reference
from pma_gym.envs import StationInfo

if TYPE_CHECKING:
    import control


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


PLACES = 26
"""Places of the stroke for which an observer is computed."""


LOOSE_N = 2.0
"""Tension below which the cable is taken for slack (N): three times what noise and rounding of the
load cell make of none."""


class Place(NamedTuple):
    """What an observer needs at one place of the stroke; z is (x, d, d') or (x, x', d, d').

    Attributes:
        lags: the lags.
        step: z one period later by z.
        older: what the older of the two voltages that act in that period adds, shape of z.
        newer: what the newer one adds.
        since: which of the voltages sent the newer one is, 1 being the last.
        correction: of z by the error that was not predicted.
        ahead: z when a voltage sent now begins to act, by z.
        flying: what the last `since` voltages add to that, oldest first, shape (len(z), since).
    """

    lags: LagDeadTimeModel
    step: np.ndarray
    older: np.ndarray
    newer: np.ndarray
    since: int
    correction: np.ndarray
    ahead: np.ndarray
    flying: np.ndarray

    @property
    def response(self) -> np.ndarray:
        """(x) or (x, x') one period on by 1 V."""
        n = len(self.lags.constants)
        return self.step[:n, n]

    def feedback(self, pole: float) -> np.ndarray:
        """Gains on (x) or (x, x') that place all poles of the loop at one place."""
        n = len(self.lags.constants)
        return placed(self.step[:n, :n], self.response, pole)

    def cancelled(self, period: float) -> np.ndarray:
        """Gains on z that take d away, as it is in the middle of the period (s) that begins."""
        return np.array([*np.zeros(len(self.lags.constants)), 1.0, 0.5 * period])


def place_of(lags: LagDeadTimeModel, period: float, delay: float, pole: float) -> Place:
    """The sampled lags at a place, with an observer's gains.

    Args:
        lags: the lags.
        period: control period T (s).
        delay: of commands and readings together (s).
        pole: of the observer, all of them.
    """
    waited = lags.dead_time + delay
    whole = int(waited / period + 1e-9)
    part = max(waited - whole * period, 0.0)
    # For how long voltages in flight have acted when one that is sent now begins to.
    period_ends = [(whole - k) * period for k in range(whole + 1)]
    spans = np.array([period, period - part, waited, *period_ends])
    step, rest, ahead, *after = expm(lags.rates * spans[:, None, None])
    driven = len(lags.constants)
    by_voltage = np.array([ahead, *after])[:, :, driven] - np.eye(len(step))[driven]
    return Place(
        lags,
        step,
        older=step[:, driven] - rest[:, driven],
        newer=rest[:, driven] - np.eye(len(step))[driven],
        since=whole + 1,
        correction=placed(step.T, step[0], pole),
        ahead=ahead,
        flying=-np.diff(by_voltage, axis=0).T,
    )


def placed(a: np.ndarray, b: np.ndarray, pole: float) -> np.ndarray:
    """K such that all poles of A - b K are `pole`: Ackermann's formula, shape (n,)."""
    n = len(b)
    reached = np.stack([np.linalg.matrix_power(a, k) @ b for k in range(n)], axis=1)
    polynomial = np.linalg.matrix_power(a - pole * np.eye(n), n)
    return np.linalg.solve(reached.T, np.eye(n)[n - 1]) @ polynomial


class ExtendedStateObserver:
    """Estimates x, its rate if there are two lags, d and its slope, from a reading a period.

    Places are those of the motion expected, not of the measured one, whose noise would be
    multiplied.

    Args:
        motion: the nominal motion.
        bandwidth: omega_o in units of 1 / reaction time, see `pole`: of all poles of its error.

    Attributes:
        places: over the stroke, evenly spaced.
        order: number of lags.
        at: number of the place where the motion is now.
    """

    def __init__(self, motion: NominalMotion, bandwidth: float) -> None:
        station, stroke = motion.station, motion.stroke
        self._motion, self._position = motion, station.position
        self._period, self._late = station.period, station.observation_delay
        self._delay = station.action_delay + station.observation_delay
        # Two lags if the regulator is the actuator: its own, and the muscle's.
        self.order, self.at = 2 if station.task.actuator == "regulator" else 1, 0
        self._loose = LOOSE_N if "cable" in station.model.parameters else -math.inf
        positions = np.linspace(stroke.first, stroke.last, PLACES).tolist()
        lags = [
            lag_dead_time_model(motion.local(position), self._period, self.order)
            for position in positions
        ]
        self.places = [
            place_of(each, self._period, self._delay, self.pole(each, bandwidth)) for each in lags
        ]
        self._first, self._scale = stroke.first, (PLACES - 1) / (stroke.last - stroke.first)
        self._estimate = np.zeros(self.order + 2)
        self._sent = np.zeros(max(place.since for place in self.places) + 1)
        self._started = False

    def pole(self, lags: LagDeadTimeModel, bandwidth: float) -> float:
        """Sampled pole of a bandwidth in units of 1 / reaction time.

        The reaction time is how long after something happens a voltage begins to act on it, at
        worst: a control period, the loop's delays and the dead time of the place. So one number
        suits every loop.
        """
        reaction = self._period + self._delay + lags.dead_time
        return math.exp(-bandwidth * self._period / reaction)

    def nearest(self, position: float) -> int:
        """Number of the place nearest to a position (m or rad)."""
        return round(min(max((position - self._first) * self._scale, 0.0), PLACES - 1.0))

    def update(self, observation: Measurement, time: float) -> np.ndarray:
        """Take in a reading, once a period.

        A slack cable says nothing about the muscle: while it is, the slope of d is 0, or it would
        carry on for as long as the rotor flies.

        Args:
            observation: what the sensors say now.
            time: now (s).
        Returns:
            z when a voltage that is sent now begins to act: (x, d, d') or (x, x', d, d').
        """
        expected = self._motion.expected(time - self._late)
        error = self._position(observation) - expected
        self.at = self.nearest(expected)
        place, sent, z = self.places[self.at], self._sent, self._estimate
        if self._started:
            z = place.step @ z + place.older * sent[-place.since - 1]
            z += place.newer * sent[-place.since]
        self._started = True
        z = z + place.correction * (error - z[0])
        if observation.load < self._loose:
            z[-1] = 0.0
        self._estimate = z
        return place.ahead @ z + place.flying @ sent[-place.since :]

    def send(self, voltage: float) -> None:
        """Take note of the voltage sent (V), less the feed-forward's."""
        self._sent[:-1] = self._sent[1:]
        self._sent[-1] = voltage

    def linear(self, at: int, feedback: np.ndarray) -> "control.StateSpace":
        """Observer and feedback v = -feedback z at a place: voltage (V) by error (m or rad).

        Args:
            at: number of the place.
            feedback: on z as `update` returns it.
        """
        import control

        place = self.places[at]
        n, sent = len(place.step), place.since + 1
        # z before its correction, by z and the voltages sent before, oldest first.
        predicted = np.hstack([place.step, np.zeros((n, sent))])
        predicted[:, n], predicted[:, n + 1] = place.older, place.newer
        kept = np.eye(n) - np.outer(place.correction, np.eye(n)[0])
        flying = np.hstack([np.zeros((n, n + 1)), place.flying])
        c = -feedback @ (place.ahead @ kept @ predicted + flying)
        d = float(feedback @ place.ahead @ place.correction)
        shifted = np.hstack([np.zeros((sent - 1, n + 1)), np.eye(sent - 1)])
        a = np.vstack([kept @ predicted, shifted, c])
        b = np.concatenate([-place.correction, np.zeros(sent - 1), [d]])
        return control.StateSpace(a, b[:, None], c[None, :], d, self._period)


Settings = TypeVar("Settings", bound=NamedTuple)


class ObserverFeedback(ABC, Generic[Settings]):
    """A feed-forward, and beside it a voltage by what a lag observer estimates.

    z is the observer's estimate (`LagDeadTimeModel`) of when a voltage sent now begins
    to act. What is sent is held to 0-10 V, and the observer receives what was sent, so nothing
    winds up.

    Args:
        settings: settings to use instead of the designed ones.
    """

    name: str
    _motion: NominalMotion
    _observer: ExtendedStateObserver

    def __init__(self, settings: Settings | None = None) -> None:
        self._fixed_settings = settings

    @abstractmethod
    def _design(self, motion: NominalMotion) -> None:
        """Keep the motion, begin an observer and compute what the places need."""

    @abstractmethod
    def _unclipped_voltage(self, planned: float, z: np.ndarray) -> float:
        """Voltage (V), not held to limits, by that of the feed-forward (V) and z."""

    @abstractmethod
    def _gains(self, at: int) -> np.ndarray:
        """Gains on z (V by its units) at the place of a number, where the law is linear."""

    def _planned(self, time: float) -> float:
        """Feed-forward (V) to send at a time (s)."""
        return self._motion.command(time)

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Compute the gains at all places of the stroke, and clear the controller's state."""
        self._design(nominal_motion(reference, station))

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V) of the task's actuator to hold for the next control period."""
        z = self._observer.update(measurement, time)
        planned = self._planned(time)
        voltage = min(max(self._unclipped_voltage(planned, z), 0.0), VOLTAGE_LIMIT)
        self._observer.send(voltage - planned)
        return voltage

    def linear(self, station: StationInfo, position: float) -> "control.StateSpace":
        """The feedback near a position (m or rad) where it is linear: volts by error."""
        made = type(self)(self._fixed_settings)
        made._design(nominal_motion(station.task.schedule.at, station))
        at = made._observer.nearest(position)
        return made._observer.linear(at, made._gains(at))
