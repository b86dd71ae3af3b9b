"""An extended state observer on the lag and dead-time model of the nominal plant."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import expm

from controllers.models.lag_model import LagDeadTimeModel, lag_dead_time_model
from controllers.models.nominal_motion import NominalMotion
from pma_gym.envs import Measurement

if TYPE_CHECKING:
    import control

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
    begun = [(whole - k) * period for k in range(whole + 1)]
    spans = np.array([period, period - part, waited, *begun])
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
    wanted = np.linalg.matrix_power(a - pole * np.eye(n), n)
    return np.linalg.solve(reached.T, np.eye(n)[n - 1]) @ wanted


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
        self._begun = False

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
        if self._begun:
            z = place.step @ z + place.older * sent[-place.since - 1]
            z += place.newer * sent[-place.since]
        self._begun = True
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
