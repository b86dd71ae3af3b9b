"""Iterative learning: the voltage of the next trial from the error that the last one left.

The nominal plant of a whole trial as one matrix, and its inverse up to a frequency.

All steps of a trial make one vector: y = G v, G the local model in force at each step,

    y(k) = -a_1 y(k-1) - ... - a_n y(k-n) + b_1 v(k-1) + ... + b_n v(k-n),   y = A^-1 B v

with banded matrices A and B. The change d of the voltages that an error o asks for is

    argmin |o - G d|^2 + rho |D2 d|^2,   D2 the second difference

With d = A s, and G d = B s as long as models change slowly along the trial, the normal equations in
s are banded too, and their solution takes some milliseconds. d is the inverse of G behind a
low-pass without phase: for one frequency |G|^2 / (|G|^2 + rho |D2|^2).

Source:
    D. A. Bristow, M. Tharayil and A. G. Alleyne 2006, "A survey of iterative learning control",
    IEEE Control Systems Magazine 26(3), the lifted form and quadratic design.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.ndimage import binary_opening
from scipy.sparse.linalg import spsolve

from controllers.design.designs import designed, scheduled_gains
from controllers.models.nominal_motion import NominalMotion, nominal_motion
from controllers.observers.extended_state_observer import LOOSE_N
from controllers.pid import FeedforwardPID
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo

HOLD = 1e-4
"""Cost of a change of voltage, relative to the cost of the error that it corrects."""

LOOSE = 1.0
"""The same while the cable is slack."""


class LiftedModel:
    """G of the voltages sent in a trial's steps.

    Args:
        motion: the nominal motion.
        late: after how many steps a voltage is in force and its effect measured.
        count: number of steps.
    """

    def __init__(self, motion: NominalMotion, late: int, count: int) -> None:
        self._period, self._count = motion.station.period, count
        times = self._period * np.arange(late, late + count)
        models = [motion.local(motion.expected(time)) for time in times.tolist()]
        back = range(1, len(models[0].b) + 1)
        below = [-k for k in back]
        a, b = np.array([-one.a[:, 0] for one in models]), np.array([one.b for one in models])
        square = count, count
        self._a = banded([np.ones(count), *(a[k:, k - 1] for k in back)], [0, *below], square)
        self._b = banded([b[k:, k - 1] for k in back], below, square)
        middle = models[count // 2]
        self._static, self._lag = middle.gain, middle.time_constant

    def response(self, voltage: np.ndarray) -> np.ndarray:
        """G v (m or rad), shape (count,)."""
        return self._b @ spsolve(self._a, voltage)

    def change(self, error: np.ndarray, taut: np.ndarray, cutoff: float) -> np.ndarray:
        """The change of voltage (V) that would take an error away, up to a frequency.

        Args:
            error: shape (count,).
            taut: which steps say something, shape (count,).
            cutoff: where |G|^2 = rho |D2|^2, so that half is learned (Hz).
        """
        corner = 2.0 * math.pi * cutoff
        rough = 1.0 / ((corner * self._period) ** 4 * (1.0 + (corner * self._lag) ** 2))
        seen = sparse.diags_array(taut.astype(float) / self._static)
        second = second_difference(self._count)
        near = sparse.diags_array((taut[:-2] & taut[1:-1] & taut[2:]).astype(float))
        price = near @ second @ self._a * math.sqrt(rough)
        penalty = sparse.diags_array(np.sqrt(np.where(taut, HOLD, LOOSE))) @ self._a
        effect = seen @ self._b
        normal = effect.T @ effect + price.T @ price + penalty.T @ penalty
        return self._a @ spsolve(normal.tocsc(), effect.T @ (seen @ error))


def second_difference(count: int) -> sparse.csc_array:
    """D2 of so many steps, sparse, shape (count - 2, count)."""
    return banded([1.0, -2.0, 1.0], [0, 1, 2], (count - 2, count))


def banded(
    diagonals: Sequence[ArrayLike], offsets: Sequence[int], shape: tuple[int, int]
) -> sparse.csc_array:
    """A sparse matrix of diagonals, each with its offset from the main one."""
    matrix = sparse.diags_array(diagonals, offsets=offsets, shape=shape)  # type: ignore[arg-type]
    return matrix.tocsc()


class Settings(NamedTuple):
    """Settings of `ILC`.

    Attributes:
        cutoff: frequency above which nothing is learned (Hz).
        feedback: share of the gains of `feedforward_pid` that correct within a trial. What repeats
            needs none, and each passes on noise; what comes only once needs it.
        mismatch: relative error of the nominal model that is reckoned with.
    """

    cutoff: float
    feedback: float
    mismatch: float


BOUNDS = {"cutoff": (0.5, 20.0), "feedback": (0.05, 1.0), "mismatch": (0.1, 1.0)}
"""Between what a search looks for settings."""

DEFAULTS = {
    "displacement": Settings(3.0, 0.3, 0.3),
    "rotation": Settings(3.0, 0.3, 0.3),
    "contraction": Settings(3.0, 0.3, 0.3),
}
"""Settings by kind of task for what `controllers/design/designs.toml` does not give."""

LEAST_STEPS = 10
"""Fewest steps of a trial that are learned from: others say nothing of a motion."""


TIGHT_STEPS = 5
"""For how many steps a cable must pull on end to be taken for tight."""


class ILC:
    """Learns the feed-forward of a repeated trial, on top of a soft PID.

    In trial j the voltage is v_j + f_j: v_j, by control step, is learned; f_j is what a PID with
    low gains adds. The error that v_j alone would leave is, G the nominal plant near the reference,

        o_j = e_j + G f_j

    in which the sensor's noise n stands as it is, G (v - v_j) + n with the ideal voltage v: neither
    shaped nor multiplied by the feedback. The change of v_j is norm-optimal, in lifted form (all
    steps of a trial as one vector) with the second difference D2 as its price:

        d_j = argmin |o_j - G d|^2 + rho |D2 d|^2

    That is the inverse of G behind a low-pass without phase, G'G / (G'G + rho D2'D2): a Q-filter
    whose corner rho sets (`controllers.ilc`).

    v_(j+1) = v_j + k_j d_j. A gain of 1 would pass every trial's noise on to the next. With b_j the
    power of what is still to be learned, r of what differs from trial to trial, and a model that is
    wrong by the share delta, the power of error p_j = b_j + n_j r that v_j leaves is least after

        k_j = p_j / ((1 + delta^2) p_j + r)
        b_(j+1) = (1 - k_j)^2 b_j + k_j^2 delta^2 p_j,   n_(j+1) = (1 - k_j)^2 n_j + k_j^2

    Near 1 as long as there is something to learn, this turns into 1 / (j + 1), the mean of all
    trials, as in Kalman's filter. b_0 is what the first trial shows above the sensor's noise; r is
    that noise, or more, where later trials leave more than they should (disturbances).

    The pulley's angle says nothing about the muscle while the cable is slack: those steps are not
    learned from, and little changed.

    Before a trial `reset` is to be called with the reference and station of the one before; with
    others, and after `repetitions` trials, learning begins anew.

    Args:
        settings: settings to use instead of the designed ones.

    Example:
        >>> from controllers import ILC
        >>> from pma_gym.envs import PMAEnv
        >>> env = PMAEnv("displacement", pressure_kpa=150.0, randomisation="varied")
        >>> controller, left = ILC(), []
        >>> for trial in range(3):
        ...     _, ended = env.reset(seed=300), False
        ...     controller.reset(env.reference, env.station)
        ...     while not ended:
        ...         volts = controller.act(env.measurement, env.time)
        ...         *_, ended, info = env.step(env.action(volts))
        ...     left.append(info["rmse_mm"])
        >>> bool(left[2] < 0.5 * left[0])
        True

    Source:
        D. A. Bristow, M. Tharayil and A. G. Alleyne 2006, "A survey of iterative learning control",
        IEEE Control Systems Magazine 26(3): lifted form, quadratic design, Q-filter, feedback in
        parallel, gains that vary with the iteration.
    """

    name = "ilc"
    repetitions = 10

    def __init__(self, settings: Settings | None = None) -> None:
        self._fixed_settings = settings
        self._learning_trials = LearningTrials(self.repetitions)

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Learn from the trial before, or begin anew."""
        motion = nominal_motion(reference, station)
        if self._learning_trials.goes_on(motion):
            self._learn()
        else:
            self._motion = motion
            self.settings = self._fixed_settings or designed(self.name, station, DEFAULTS)
            self.learned = np.zeros(len(motion.volts))
            self._gain = LearningGain(self.settings.mismatch)
        self._position, self._late = station.position, station.observation_delay
        self._loose = loose_load(station)
        self._errors, self._added, self._taut = list[float](), list[float](), list[bool]()
        gains, share = scheduled_gains(FeedforwardPID.name, station), self.settings.feedback
        soft = [share * gain for gain in (gains.proportional, gains.integral, gains.derivative)]
        self._pid = FeedforwardPID(
            gains._replace(proportional=soft[0], integral=soft[1], derivative=soft[2]),
            _Learned(motion, self.learned),
        )
        self._pid.reset(reference, station)

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V) of the task's actuator to hold for the next control period."""
        voltage = self._pid.act(measurement, time)
        self._errors.append(self._motion.expected(time - self._late) - self._position(measurement))
        self._added.append(voltage - self._pid.feedforward(time))
        self._taut.append(measurement.load >= self._loose)
        return voltage

    def _learn(self) -> None:
        """Change the voltages by what the last trial says."""
        station, motion = self._motion.station, self._motion
        sent_late = round(station.action_delay / station.period)
        late = sent_late + round(station.observation_delay / station.period)
        count = len(self._errors) - late
        if count < LEAST_STEPS:
            return
        # A voltage sent in step k shows in the errors from step k + late + 1 on.
        plant = LiftedModel(motion, late, count)
        without = np.array(self._errors[late:]) + plant.response(np.array(self._added[:count]))
        change = plant.change(without, tight(self._taut[late:]), self.settings.cutoff)
        smooth = 2.0 * self.settings.cutoff * station.period
        power = float(np.mean(plant.response(change) ** 2)) / (smooth * motion.noise**2)
        # The voltages are kept by the period that they are in force in.
        learned = self.learned.copy()
        learned[sent_late : sent_late + count] += (self._gain.next(power) * change)[
            : len(learned) - sent_late
        ]
        volts = motion.volts
        reachable = np.clip(volts + learned, np.minimum(volts, 0.0), np.maximum(volts, 10.0))
        self.learned = reachable - volts


class LearningTrials:
    """Counts the trials on one station and reference.

    Args:
        repetitions: after how many learning begins anew.

    Attributes:
        trials: how many there were, with the one that has begun last.
    """

    def __init__(self, repetitions: int) -> None:
        self._repetitions, self.trials = repetitions, 0
        self._motion: NominalMotion | None = None

    def goes_on(self, motion: NominalMotion) -> bool:
        """Count a trial that begins; whether it repeats the one before."""
        before = self._motion
        goes_on = (
            before is not None
            and before.station == motion.station
            and np.array_equal(before.volts, motion.volts)
            and self.trials < self._repetitions
        )
        self._motion, self.trials = motion, self.trials + 1 if goes_on else 1
        return goes_on


def loose_load(station: StationInfo) -> float:
    """Load (N) below which the cable may be slack, so that the position says nothing."""
    return LOOSE_N if station.task.schedule.followed.is_angle else -math.inf


def tight(taut: Sequence[bool]) -> NDArray[np.bool_]:
    """In which steps a cable pulls, shape (steps,).

    One that is tight for a moment only, or by the load cell's noise, is still slack, and the first
    reading after it has come tight still that of the flight.

    Args:
        taut: by step, whether the load cell says so.
    """
    pulling = np.array(binary_opening(taut, np.ones(TIGHT_STEPS)), bool)
    pulling[1:] &= pulling[:-1].copy()
    return pulling


class LearningGain:
    """k_j by trial, see `ILC`; powers in units of that of the sensor's noise.

    Args:
        mismatch: the relative error of the model that is reckoned with.
    """

    def __init__(self, mismatch: float) -> None:
        self._doubt = mismatch**2
        self._left, self._noise, self._varying = -1.0, 0.0, list[float]()

    def next(self, power: float) -> float:
        """The gain on the change that a trial asks for.

        Args:
            power: of what that change would move the position by.
        """
        if self._left < 0.0:
            self._left = max(power - 1.0, 0.0)
        else:
            self._varying.append(max(1.0, (power - self._left) / (1.0 + self._noise)))
        varying = float(np.mean(self._varying)) if self._varying else 1.0
        total = self._left + self._noise * varying
        gain = total / ((1.0 + self._doubt) * total + varying)
        self._left = (1.0 - gain) ** 2 * self._left + gain**2 * self._doubt * total
        self._noise = (1.0 - gain) ** 2 * self._noise + gain**2
        return gain


class _Learned:
    """The nominal motion's voltage and what has been learned, as an open loop."""

    def __init__(self, motion: NominalMotion, learned: np.ndarray) -> None:
        self._motion, self._learned = motion, learned.tolist()
        self._period = motion.station.period

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Nothing to compute."""

    def voltage(self, time: float) -> float:
        """Voltage (V) of the period at a time (s)."""
        at = min(max(int(time / self._period + 1e-6), 0), len(self._learned) - 1)
        return self._motion.voltage(time) + self._learned[at]
