"""A policy with iterative learning: each trial moves its reference by the error that is left."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from controllers.design.designs import task_kind
from controllers.ilc import (
    LEAST_STEPS,
    LearningGain,
    LearningTrials,
    loose_load,
    second_difference,
    tight,
)
from controllers.models.nominal_motion import NominalMotion, nominal_motion
from controllers.policies.document import PolicyError
from controllers.policy import ShippedPolicy
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo

CUTOFF_HZ = 8.0
"""Frequency at which half of an error is learned (Hz)."""

LEAD_STEPS = 3
"""By how many control steps a change of the reference is given early: so late does the position
follow it, at 100 Hz without delays. At other rates and delays it was not tried."""

MISMATCH = 0.3
"""Relative error that is reckoned with where a change of the reference is taken for one of the
position."""

ALONE = 5
"""Trials that the policy drives on what the sensors say. In all later ones it receives less of
what did not happen in the earlier ones."""

LEAST_SHARE = 0.35
"""Least share of such a deviation that it receives."""

HOLD = 1e-3
"""Cost of a move of the reference, relative to the cost of the error that it corrects."""


class PolicyWithILC:
    """The shipped policy of PPO with iterative learning over the trials of a station.

    Iterative learning in series: the policy stays unchanged, its inputs change. In
    trial j it follows r + s_j, s_1 = 0. What the sensor says at the end differs from what it would
    say of r by o_j, and

        d_j = argmin |o_j - d|^2 + rho |D2 d|^2,   s_(j+1) = s_j + k_j d_j

    with the second difference D2: a low-pass without phase. It takes the position for what the
    policy is to follow, `LEAD_STEPS` later. The gains k_j are those of `controllers.ILC`.

    What is left then is mostly the sensors' noise, which the policy answers as it would answer an
    error. So once there are trials to compare with it receives m + c (x - m): x a reading, m the
    mean of that reading over the earlier trials. That of the sensor that the task goes by is moved
    as s has been since, the other position's is not. c is the share of the power of x - m, from
    trial to trial, that is not the sensor's noise, but `LEAST_SHARE` at least; it is computed for
    the task's sensor and holds for all. Where trials repeat each other that is a feedback three
    times as soft; where disturbances come that do not repeat, c is nearly 1.

    `CUTOFF_HZ`, `LEAD_STEPS`, `ALONE` and `LEAST_SHARE` were chosen on 24 validation stations of
    suite `robust` (displacement; 16 in rotation), of which no suite has one.

    As with `controllers.ILC` `reset` is to be called with the reference and station of the trial
    before; with others, and after `repetitions` trials, learning begins anew.

    Attributes:
        algorithm: of the shipped policies that it runs; its figures depend on their files.
        moved: by how much the reference is moved (m or rad), by control step.
    Source:
        D. A. Bristow, M. Tharayil and A. G. Alleyne 2006, "A survey of iterative learning control",
        IEEE Control Systems Magazine 26(3), the serial arrangement.
    """

    name = "ppo_ilc"
    algorithm = "ppo"
    kinds = frozenset({"displacement", "rotation"})
    repetitions = 10

    def __init__(self) -> None:
        self._policy = ShippedPolicy(self.algorithm)
        self._learning_trials = LearningTrials(self.repetitions)

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Learn from the trial before, or begin anew.

        Raises:
            PolicyError: a kind of task that it does not learn, or no policy is shipped for this
                kind of task and loop.
        """
        kind = task_kind(station)
        if kind not in self.kinds:
            raise PolicyError(
                f"{self.name} learns {' and '.join(sorted(self.kinds))}, the task's kind is "
                f"{kind}; take a policy that needs no learning trials, such as {self.algorithm}"
            )
        # Refuses a station that it was not trained for before anything has changed.
        self._policy.reset(reference, station)
        motion = nominal_motion(reference, station)
        if self._learning_trials.goes_on(motion):
            self._learn()
        else:
            self._motion = motion
            self.moved = np.zeros(len(motion.volts) + 1)
            self._gain = LearningGain(MISMATCH)
            self._earlier = EarlierTrials(len(motion.volts))
        alone = self._learning_trials.trials <= ALONE
        self._softened = None if alone else self._earlier.softened(self.moved, motion)
        self._policy.reset(_Moved(reference, self.moved, station.period).at, station)
        self._loose = loose_load(station)
        self._readings = list[Measurement]()
        self._errors, self._taut = list[float](), list[bool]()

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V, 0-10) to hold for the next control period.

        Raises:
            RuntimeError: it was not reset.
        """
        if not self._learning_trials.trials:
            raise RuntimeError(f"{self.name} has no trial: call reset() before act()")
        station, step = self._motion.station, len(self._readings)
        expected = self._motion.expected(time - station.observation_delay)
        self._errors.append(expected - station.position(measurement))
        self._taut.append(measurement.load >= self._loose)
        self._readings.append(measurement)
        if self._softened is not None:
            measurement = self._softened.reading(measurement, step)
        return self._policy.act(measurement, time)

    def _learn(self) -> None:
        """Move the reference by what the last trial says, and remember its readings."""
        self._earlier.add(self._readings, self.moved)
        count = len(self._errors)
        if count < LEAST_STEPS:
            return
        period = self._motion.station.period
        change = smooth(
            np.array(self._errors), tight(self._taut), 2.0 * math.pi * CUTOFF_HZ * period
        )
        power = float(np.mean(change**2)) / (2.0 * CUTOFF_HZ * period * self._motion.noise**2)
        # Of a trial that broke off nothing is known of what would have followed.
        early = np.append(change[LEAD_STEPS:], np.full(LEAD_STEPS, change[-1]))
        moved = self.moved.copy()
        moved[:count] += self._gain.next(power) * early[: len(moved)]
        if count >= len(moved) - 1:
            moved[count:] = moved[count - 1]
        self.moved = moved


class EarlierTrials:
    """Readings of earlier trials, and by how much the reference was moved then.

    The first trial is left out: its errors are still to be learned.

    Args:
        steps: control steps of a whole trial.
    """

    def __init__(self, steps: int) -> None:
        self._steps, self._first = steps, True
        self._readings, self._moves = list[NDArray[np.float64]](), list[NDArray[np.float64]]()

    def add(self, readings: Sequence[Measurement], moved: NDArray[np.float64]) -> None:
        """Store a trial if it is complete."""
        if not self._first and len(readings) >= self._steps:
            self._readings.append(np.array([reading[1:] for reading in readings[: self._steps]]))
            self._moves.append(moved)
        self._first = False

    def softened(self, moved: NDArray[np.float64], motion: NominalMotion) -> "Softened | None":
        """What readings of the next trial are compared with; None of fewer than two trials.

        Args:
            moved: by how much the reference is moved in it (m or rad), by control step.
            motion: the nominal motion.
        """
        if len(self._readings) < 2:
            return None
        station = motion.station
        instants = station.period * np.arange(len(moved))
        taken = instants[: self._steps] - station.observation_delay - motion.sensor_lag

        def shown(moves: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.interp(taken, instants, moves)

        mean, places = np.mean(self._readings, axis=0), shown(np.mean(self._moves, axis=0))
        column = Measurement._fields.index(station.task.schedule.quantity) - 1
        apart = [
            readings[:, column] - mean[:, column] - shown(moves) + places
            for readings, moves in zip(self._readings, self._moves, strict=True)
        ]
        power = float(np.sum(np.square(apart))) / (self._steps * (len(apart) - 1))
        mean[:, column] += shown(moved) - places
        share = 1.0 - motion.noise**2 / power if power > 0.0 else 0.0
        return Softened(mean.tolist(), max(share, LEAST_SHARE))


class Softened:
    """Readings with less of what sets them apart from those of earlier trials.

    Args:
        means: what is expected of each sensor (SI), by control step.
        share: of the deviation that the policy receives.
    """

    def __init__(self, means: list[list[float]], share: float) -> None:
        self.means, self.share = means, share

    def reading(self, reading: Measurement, step: int) -> Measurement:
        """Measurement that the policy receives in a control step; unchanged beyond the last one."""
        if step >= len(self.means):
            return reading
        share = self.share
        values = [m + share * (x - m) for m, x in zip(self.means[step], reading[1:], strict=True)]
        return Measurement(reading[0], *values)


def smooth(
    error: NDArray[np.float64], taut: NDArray[np.bool_], corner: float
) -> NDArray[np.float64]:
    """The slow part of an error, by a low-pass without phase.

        argmin |o - d|^2 + rho |D2 d|^2,   1 / (1 + (w / corner)^4) of a frequency w

    Args:
        error: by control step (m or rad), shape (steps,).
        taut: which steps say something, shape (steps,); the others are drawn through.
        corner: where half is left (rad per step).
    Returns:
        Shape (steps,).
    """
    second, seen = second_difference(len(error)), taut.astype(float)
    price = second.T @ second / corner**4 + HOLD * sparse.eye_array(len(error))
    return np.asarray(spsolve((sparse.diags_array(seen) + price).tocsc(), seen * error))


class _Moved:
    """A reference that was moved by a number for each control step."""

    def __init__(self, reference: Reference, moves: NDArray[np.float64], period: float) -> None:
        self._reference, self._moves, self._period = reference, moves.tolist(), period

    def at(self, time: float) -> float:
        """The moved reference (m or rad) at a time (s)."""
        step = min(max(round(time / self._period), 0), len(self._moves) - 1)
        return self._reference(time) + self._moves[step]
