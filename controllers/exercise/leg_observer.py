"""Kalman filters of fixed gain for the leg and the regulator of an exercise.

    theta' = w,   I w' = M_h - M - D w,   M_h' = s,   s' = -s / fade + white
    e' = white,   angle = theta,   (extension + tension / k) / r = theta + e
    P' = (P_c + g - P) / tau,   g' = white

M_h is the operator's moment, M the one at the joint by the load cell, so that nothing of the
muscle need be known; I and D are the nominal leg's, rotor and slide's share with it. The angle by
the extension is finer than the potentiometer, but off by the cable's slack, which e is. g is what
the regulator's line is off, held to `Arrival`'s bound: what the safety layer holds back is not
taken for more.

Prediction of an exercise's joint, and the quadratic program built on it.

All are deviations from now, but speeds and the operator's slope. The moment that the pressure makes
stands in place of the pressure, q = h (P - P_0), u = h (P_c + g - P_0), h the change of the moment
by the pressure, so that the model does not depend on h:

    theta' = w
    I w'   = m + d - D w - q - (k + K) theta - c (w - w_0)
    q'     = (u - q) / tau,   m' = s,   s' = -s / fade
    M      = q + k theta + c (w - w_0)

m is what the operator gives beyond the moment M at the joint, d what he is expected to give more
later, K the stiffness of his joint, k the device's at its pressure and angle, c = b(P) r^2 the
muscle's damping at the pulley.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from controllers.exercise.resistance import AWAY_PA
from pma_gym.envs import Measurement, StationInfo


class ProcessNoise(NamedTuple):
    """Process noise of the filters, in SI; assumptions, chosen by trial.

    Attributes:
        operator: change of the operator's moment (N m per s^0.5).
        slope: change of its slope (N m/s per s^0.5).
        fade: time constant in which a slope is lost (s).
        speed: change of the speed by what is not modelled (rad/s per s^0.5).
        slack: change of e (rad per s^0.5).
        pressure: change of the pressure by what is not modelled (Pa per s^0.5).
        line: change of g (Pa per s^0.5).
    """

    operator: float = 2.0
    slope: float = 20.0
    fade: float = 0.3
    speed: float = 1e-2
    slack: float = 3e-3
    pressure: float = 5e3
    line: float = 8e3


class LegObserver:
    """The filter of the leg.

    Args:
        station: the station as the controller knows it.
        process_noise: what is unknown.

    Attributes:
        state: theta (rad), w (rad/s), M_h (N m), s (N m/s) and e (rad) at the last reading.
    """

    def __init__(self, station: StationInfo, process_noise: ProcessNoise) -> None:
        cable, sensors = station.model.parameters["cable"], station.model.parameters
        self._radius, self._stiffness = sensors["rotor"].radius, cable.stiffness
        self._station = station
        noise = (
            process_noise.speed,
            process_noise.operator,
            process_noise.slope,
            process_noise.slack,
        )
        process = np.diag(np.square([0.0, *noise])) * station.period
        spread = np.square([sensors["potentiometer"].noise, sensors["lvdt"].noise / self._radius])
        self._whole, self._push = _leg(station, process_noise.fade)
        self._seen = np.array([[1.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 1.0]])
        self._gain = settled_gain(self._whole, self._seen, process, np.diag(spread))
        # A load that the trial begins with has stretched the cable already.
        self._stretch = station.load / self._stiffness
        self._moment = self._radius * station.load
        self.state = np.array([0.0, 0.0, self._moment, 0.0, 0.0])

    def update(self, reading: Measurement) -> None:
        """Take a reading, a period after the last."""
        moment = self._station.moment(reading)
        wound = reading.extension + reading.load / self._stiffness - self._stretch
        said = np.array([reading.rotation, wound / self._radius])
        x = self._whole @ self.state + self._push * (0.5 * (self._moment + moment))
        self.state, self._moment = x + self._gain @ (said - self._seen @ x), moment


class PressureObserver:
    """The filter of the regulator.

    Args:
        station: the station as the controller knows it.
        process_noise: what is unknown.

    Attributes:
        pressure: P at the last reading (Pa).
        offset: g (Pa).
    """

    def __init__(self, station: StationInfo, process_noise: ProcessNoise) -> None:
        parameters = station.model.parameters
        kept = np.exp(-station.period / parameters["regulator_lag"].time_constant)
        whole = np.array([[kept, 1.0 - kept], [0.0, 1.0]])
        process = np.diag(np.square([process_noise.pressure, process_noise.line])) * station.period
        spread = np.array([[parameters["pressure_transducer"].noise ** 2]])
        gain = settled_gain(whole, np.array([[1.0, 0.0]]), process, spread)
        self._kept, self._gain = float(kept), [float(value) for value in gain[:, 0]]
        self.pressure, self.offset = station.pressure, 0.0

    def update(self, pressure: float, commanded: float) -> None:
        """Take a pressure (Pa), a period after the last, in which one was commanded (Pa)."""
        reached = commanded + self.offset
        believed = reached + self._kept * (self.pressure - reached)
        error = pressure - believed
        self.pressure = believed + self._gain[0] * error
        self.offset = min(max(self.offset + self._gain[1] * error, -AWAY_PA), AWAY_PA)


def leg_of(station: StationInfo) -> tuple[float, float]:
    """Inertia I (kg m^2) and damping D (N m s) of all that turns with the nominal joint."""
    parameters = station.model.parameters
    leg, rotor, slide = (parameters[name] for name in ("leg", "rotor", "slide"))
    inertia = leg.inertia + rotor.inertia + slide.mass * rotor.radius**2
    return inertia, leg.damping + rotor.damping


def settled_gain(
    whole: NDArray[np.float64],
    seen: NDArray[np.float64],
    process: NDArray[np.float64],
    spread: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Gain of a Kalman filter that has run for long, shape (states, outputs)."""
    covariance = solve_discrete_are(whole.T, seen.T, process, spread)
    return np.linalg.solve(seen @ covariance @ seen.T + spread, seen @ covariance).T


def _leg(station: StationInfo, fade: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The leg over a period: what becomes of its state, and of a moment at the joint."""
    inertia, damping = leg_of(station)
    rates = np.zeros((6, 6))
    rates[0, 1] = rates[2, 3] = 1.0
    rates[1, 1:3] = -damping / inertia, 1.0 / inertia
    rates[1, 5], rates[3, 3] = -1.0 / inertia, -1.0 / fade
    over = np.asarray(expm(rates * station.period), dtype=np.float64)
    return over[:5, :5], over[:5, 5]


Array = NDArray[np.float64]

STATES = 6
"""theta, w, q, m, s and w_0."""

MOVES = 0.0, 0.01, 0.02, 0.03, 0.05, 0.08, 0.13, 0.21
"""Times after which the command may change (s), beyond the delays; in between it is held."""

PROGRAMS_KEPT = 64
"""Programs that a process keeps, some 50 kB each at 100 control steps a second."""


class Joint(NamedTuple):
    """Numbers of the model, in SI.

    Attributes:
        inertia: I (kg m^2).
        damping: D (N m s).
        lag: tau of the regulator (s).
        fade: of the operator's slope (s).
        operator: K (N m/rad).
        stiffness: k (N m/rad).
        muscle: c (N m s).
    """

    inertia: float
    damping: float
    lag: float
    fade: float
    operator: float
    stiffness: float = 0.0
    muscle: float = 0.0


class Horizon(NamedTuple):
    """Times that are predicted.

    Attributes:
        period: of the control step (s).
        stride: control steps from one predicted time to the next.
        ahead: predicted times, the first a stride from now.
        late: control steps in which commands are on their way.
    """

    period: float
    stride: int
    ahead: int
    late: int

    @property
    def edges(self) -> list[int]:
        """Control steps between which the command is held; the first is the first to choose."""
        free = self.stride * self.ahead - self.late
        moves = sorted({round(move / self.period) for move in MOVES})
        return [self.late + move for move in moves if move < free] + [self.late + free]


class Program(NamedTuple):
    """Least v' H v / 2 + q' v over the commands v, in the form of u (N m).

    Attributes:
        square: H, shape (moves, moves).
        pull: q by the errors predicted, shape (moves, ahead).
        state: outputs by theta, w, q, m, s and w_0 of now, shape (outputs, ahead, 6).
        drift: outputs by d of every stride, shape (outputs, ahead, ahead).
        past: outputs by the commands on their way, shape (outputs, ahead, late).
    """

    square: Array
    pull: Array
    state: Array
    drift: Array
    past: Array


@lru_cache(maxsize=PROGRAMS_KEPT)
def programmed(joint: Joint, of_moment: bool, effort: float, horizon: Horizon) -> Program:
    """The program of a joint.

    Outputs are the angle and, if the cost is of it, the moment: the last is what the cost is of.

    Args:
        joint: the model's numbers.
        of_moment: whether the cost is of the moment, or of the angle.
        effort: weight of a change of the command beside the mean square of the errors.
        horizon: what is predicted.
    """
    k, c = joint.stiffness, joint.muscle
    outputs = np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [k, c, 1.0, 0.0, 0.0, -c]])
    state, drift, command = predicted(joint, outputs[: 1 + of_moment], horizon)
    edges = np.array(horizon.edges)
    effect = np.add.reduceat(command[-1], edges[:-1], axis=1)
    pull = effect.T / horizon.ahead
    changes = np.eye(len(edges) - 1) - np.eye(len(edges) - 1, k=-1)
    square = pull @ effect + effort * changes.T @ changes
    drift = np.add.reduceat(drift, horizon.stride * np.arange(horizon.ahead), axis=2)
    return Program(square, pull, state, drift, command[:, :, : horizon.late].copy())


def predicted(joint: Joint, outputs: Array, horizon: Horizon) -> tuple[Array, Array, Array]:
    """Outputs at the predicted times, by the state of now and by d and u of every control step.

    Args:
        joint: the model's numbers.
        outputs: by the states, shape (outputs, 6).
        horizon: n control steps in all.
    Returns:
        Shapes (outputs, ahead, 6), (outputs, ahead, n) and (outputs, ahead, n).
    """
    whole, *columns = _step(joint, horizon.period)
    every = [outputs]
    for _ in range(horizon.stride * horizon.ahead):
        every.append(every[-1] @ whole)
    seen = np.array(every)
    pulses = [_toeplitz(seen[:-1] @ column, horizon.stride) for column in columns]
    return seen[horizon.stride :: horizon.stride].swapaxes(0, 1), pulses[0], pulses[1]


def _step(joint: Joint, period: float) -> tuple[Array, Array, Array]:
    """The states over a control step: by themselves, by d and by u."""
    push, command = STATES, STATES + 1
    rates = np.zeros((STATES + 2, STATES + 2))
    rates[0, 1] = rates[3, 4] = 1.0
    rates[1, 0] = -joint.stiffness - joint.operator
    rates[1, 1:STATES] = -joint.damping - joint.muscle, -1.0, 1.0, 0.0, joint.muscle
    rates[1, push] = 1.0
    rates[1] /= joint.inertia
    rates[2, 2], rates[2, command] = -1.0 / joint.lag, 1.0 / joint.lag
    rates[4, 4] = -1.0 / joint.fade
    over = np.asarray(expm(rates * period), dtype=np.float64)
    return over[:STATES, :STATES], over[:STATES, push], over[:STATES, command]


def _toeplitz(pulse: Array, stride: int) -> Array:
    """Of responses to a pulse, (n, outputs), those to one in every step: (outputs, ahead, n)."""
    count = len(pulse)
    matrices = np.zeros((pulse.shape[1], count, count))
    for j in range(count):
        matrices[:, j:, j] = pulse[: count - j].T
    return matrices[:, stride - 1 :: stride]
