"""Prediction of an exercise's joint, and the quadratic program built on it.

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
from scipy.linalg import expm

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
    strides = horizon.stride * np.arange(horizon.ahead)
    drift = np.add.reduceat(drift, strides, axis=2)
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
