"""Least variance of causal control against an unsteady operator, with the regulator's lag.

The joint stands near a point of the exercise, by the nominal plant's linear laws at 100 Hz. The
operator's moment is unsteady as `pma_gym.tasks.operator` says, his joint has its stiffness:

    w(k+1) = exp(-h/0.3 s) w(k) + ...e(k),   d(k+1) = (1 - s) d(k) + s u M w(k+1)
    x(k+1) = A x(k) + b_m (d(k+1) - k_h angle(k)) + b_v V(k)

A controller knows all of it at the beginning of a step, x, d and w, the operator's own intention,
or what Kalman's filter makes of the four sensors' noise; and not the e that the step brings. Its
voltage holds for that step, or with a delay for the next. The least E y^2 + rho E V^2, y what the
exercise holds, is a linear law of the algebraic Riccati equation's; rho is the smallest with which
three standard deviations of the voltage stay within 0-10 V. No causal controller whose voltage
varies as little does better on that plant; one that jumps from end to end of 0-10 V varies more,
and where they leave little room it may. Lag and quantisation of the sensors are left out.

The station itself has dry friction and hysteresis, which hold small motions still: without a
controller it wanders less than the linear plant. Efforts that are off by a constant or a ramp cost
a stationary law nothing, and tremor is left out: `benchmarks.exercise.lag.swing`.

Source:
    K. J. Astrom 1970, "Introduction to Stochastic Control Theory", chapter 8, from memory.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm, solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import brentq

from benchmarks.exercise.lag.points import Point, Rates, points, rates
from benchmarks.exercise.lag.repeated_exercise import LAG, NO_LAG, RATE_HZ
from pma_gym.plant.model import Model
from pma_gym.tasks import EVERY_TASK, Operator
from pma_gym.tasks.operator import WANDER_S
from pma_gym.units import SI_FACTORS

PERIOD = 1.0 / RATE_HZ
"""Control step (s)."""

DEVIATIONS = 3.0
"""How many standard deviations of the voltage stay within 0-10 V."""

FACTORS = (0.0, 0.5, 1.0, 2.0, 4.0)
"""Lags as shares of the model's; 0 stands for hardly any."""

PRICES = (1e-8, 1e6)
"""Between what rho is searched for, in (deg or N m)^2/V^2."""


@dataclass(frozen=True)
class Causal:
    """The least that is left near a point.

    Attributes:
        point: where.
        lag: time constant of the regulator (s).
        delay: control steps from a reading to its voltage.
        sensed: whether it knows what the sensors say, not everything.
        uncontrolled: standard deviation at a constant voltage (deg or N m).
        least: with the best law (deg or N m).
        voltage: standard deviation of the voltage that it takes (V).
    """

    point: Point
    lag: float
    delay: int
    sensed: bool
    uncontrolled: float
    least: float
    voltage: float


def causal_bounds(
    task: str,
    model: Model,
    factors: Sequence[float] = FACTORS,
    delays: Sequence[int] = (1,),
    operator: Operator | None = None,
) -> tuple[Causal, ...]:
    """The least standard deviations at every point of an exercise.

    Args:
        task: name of the exercise.
        model: the station, with the lag that it has.
        factors: lags as shares of the model's, 0 for hardly any.
        delays: control steps from a reading to its voltage.
        operator: the operator; None for the population's typical one.
    """
    exercise, own = EVERY_TASK[task].exercise, model.parameters["regulator_lag"].time_constant
    assert exercise is not None
    who, rows = operator or exercise.population.typical, []
    for point in points(task, model):
        for lag in (factor * own or NO_LAG for factor in factors):
            near = rates(point, model.replace({LAG: lag}))
            rows += [
                causal_bound(point, near, lag, delay, sensed, who)
                for delay in delays
                for sensed in (False, True)
            ]
    return tuple(rows)


def causal_bound(
    point: Point, near: Rates, lag: float, delay: int, sensed: bool, operator: Operator
) -> Causal:
    """The least standard deviation near one point.

    Args:
        point: where.
        near: the plant there.
        lag: time constant of its regulator (s).
        delay: control steps from a reading to its voltage.
        sensed: whether the controller knows what the sensors say, not everything.
        operator: the operator.
    """
    loop = Loop.of(point, near, delay, operator)
    gain = loop.gain(loop.cheapest_within(point.room / DEVIATIONS, sensed))
    uncontrolled = loop.deviations(np.zeros_like(gain), False)[0]
    return Causal(point, lag, delay, sensed, uncontrolled, *loop.deviations(gain, sensed))


@dataclass(frozen=True)
class Loop:
    """The operator on the plant, step by step: z(k+1) = A z + b V + g e, y = c z, s = C z + r.

    Attributes:
        a: shape (n, n).
        by_voltage: b, shape (n,).
        by_chance: g, shape (n,).
        output: c, shape (n,).
        seen: C, shape (4, n).
        noise: covariance of r, shape (4, 4).
    """

    a: NDArray[np.float64]
    by_voltage: NDArray[np.float64]
    by_chance: NDArray[np.float64]
    output: NDArray[np.float64]
    seen: NDArray[np.float64]
    noise: NDArray[np.float64]

    @classmethod
    def of(cls, point: Point, near: Rates, delay: int, operator: Operator) -> "Loop":
        """By the module's equations; z holds x, d, w and the voltages on their way."""
        n = len(near.a)
        held, by_moment, by_voltage = _held(near)
        stiffness = operator.stiffness * SI_FACTORS["deg"]
        kept, share = math.exp(-PERIOD / WANDER_S), -math.expm1(-PERIOD / operator.rise)
        size, fresh = share * operator.unsteadiness * point.moment, math.sqrt(1.0 - kept**2)
        own = held - stiffness * np.outer(by_moment, near.angle)
        a = np.asarray(block_diag(own, 1.0 - share, kept))
        moved = np.append(by_moment, 1.0)
        a[: n + 1, n + 1] = size * kept * moved
        a[:n, n] = (1.0 - share) * by_moment
        chance = np.append(size * fresh * moved, fresh)
        b, output = np.append(by_voltage, [0.0, 0.0]), np.append(near.output, [0.0, 0.0])
        for _ in range(delay):
            a = np.block([[a, b[:, None]], [np.zeros((1, len(a) + 1))]])
            b = np.append(np.zeros(len(b)), 1.0)
            chance, output = np.append(chance, 0.0), np.append(output, 0.0)
        seen = np.pad(near.seen, ((0, 0), (0, len(a) - n))) / near.noise[:, None]
        return cls(a, b, chance, output, seen, np.eye(len(seen)))

    def gain(self, price: float) -> NDArray[np.float64]:
        """The best law V = -K z where a volt squared costs so much, shape (n,)."""
        b = self.by_voltage[:, None]
        wanted = np.outer(self.output, self.output)
        cost = solve_discrete_are(self.a, b, wanted, np.array([[price]]))
        return ((b.T @ cost @ self.a) / (price + (b.T @ cost @ b))).ravel()

    def deviations(self, gain: NDArray[np.float64], sensed: bool) -> tuple[float, float]:
        """Standard deviations of what the exercise holds (deg or N m) and of the voltage (V)."""
        closed = self.a - np.outer(self.by_voltage, gain)
        unknown, correction = self._filtered if sensed else (np.zeros_like(self.a), self._chance)
        known = solve_discrete_lyapunov(closed, correction, method="bilinear")
        rows = (self.output, unknown + known), (gain, known)
        output, voltage = (math.sqrt(max(0.0, float(row @ spread @ row))) for row, spread in rows)
        return output, voltage

    @property
    def _chance(self) -> NDArray[np.float64]:
        return np.outer(self.by_chance, self.by_chance)

    @cached_property
    def _filtered(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Kalman's filter: covariance of what it does not know, and of what each reading tells."""
        before = solve_discrete_are(self.a.T, self.seen.T, self._chance, self.noise)
        innovation = self.seen @ before @ self.seen.T + self.noise
        correction = before @ self.seen.T @ np.linalg.solve(innovation, self.seen @ before)
        return before - correction, correction

    def cheapest_within(self, most: float, sensed: bool) -> float:
        """The smallest price with which the voltage's standard deviation stays below (V)."""

        def excess(exponent: float) -> float:
            return self.deviations(self.gain(10.0**exponent), sensed)[1] - most

        low, high = (math.log10(price) for price in PRICES)
        if excess(low) <= 0.0:
            return PRICES[0]
        return 10.0 ** float(brentq(excess, low, high, xtol=1e-3))  # type: ignore[arg-type]


def _held(near: Rates) -> tuple[NDArray[np.float64], ...]:
    """A, b_m and b_v of a control step in which moment and voltage are held."""
    n = len(near.a)
    both = np.stack([near.by_moment, near.by_voltage], axis=1)
    still = np.zeros((2, n + 2))
    whole = np.asarray(expm(PERIOD * np.block([[near.a, both], [still]])), np.float64)
    return whole[:n, :n], whole[:n, n], whole[:n, n + 1]
