"""The nominal plant near rest, sampled and reduced to a few states, over a task's stroke.

The full linearisation of a station has five states and one for the sensor; its cable swings at
-600 +- 880i 1/s. Held over a control period, all but the slowest of that is gone: the sampled
system is reduced by balanced truncation (square roots of the Gramians), to the lowest order whose
step response is the full one's within 0.3 % of its end, and written in observer form,

    y[k] = -a_1 y[k-1] - ... - a_n y[k-n] + b_1 u[k-1] + ... + b_n u[k-n],

whose states mean the same at every place of the stroke: models may be mixed, and an estimator may
go from one to the next.

Source:
    B. C. Moore 1981, "Principal component analysis in linear systems"; K. Zhou, J. C. Doyle and
    K. Glover 1996, "Robust and optimal control", section 7.1.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import expm

from controllers.models.voltage import VOLTAGE_LIMIT
from pma_gym.data.signals import SIGNALS
from pma_gym.plant.equilibrium.solver import equilibria_at
from pma_gym.plant.forms.linear import linearize_at
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition

if TYPE_CHECKING:
    import control

System = tuple[np.ndarray, np.ndarray, np.ndarray]
"""A, B, C of a sampled system with one input and one output; shapes (n, n), (n,), (n,)."""

PLACES = 11
"""Places of the stroke at which the plant is linearised."""

FINE = 101
"""Places for which models are kept, those between the linearised ones mixed from them."""

LARGEST_ERROR = 3e-3
"""Largest error of a reduced model's step response, as a share of its end."""

LARGEST_ORDER = 4


_SEARCHED = 201
"""Voltages at which the plant is put to rest in search of the places."""


class LocalModel(NamedTuple):
    """The plant near a place of the stroke: deviations from rest, sampled, without delay.

        x[k+1] = a x[k] + b u[k],   y[k] = c x[k]

    Attributes:
        a: shape (n, n), in observer form.
        b: shape (n,): of the actuator's voltage (V) in force from k to k + 1.
        c: shape (n,), (1, 0, ...): of the measured position (m or rad), the sensor's lag included.
        gain: static gain (m/V or rad/V).
        time_constant: the slowest lag (s).
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    gain: float
    time_constant: float


@dataclass(frozen=True, eq=False)
class Stroke:
    """Local models over a stroke, evenly spaced; equal to itself alone.

    Attributes:
        first: position of the first model (m or rad).
        last: position of the last.
        models: the models.
        volts: actuator's voltage that holds each position (V).
        pressure_slopes: motor voltage that holds each position, by the pressure (V/Pa); 0 where
            the regulator is the actuator.
    """

    first: float
    last: float
    models: tuple[LocalModel, ...]
    volts: tuple[float, ...]
    pressure_slopes: tuple[float, ...]

    def nearest(self, position: float) -> int:
        """Index of the model nearest to a position (m or rad); beyond the ends, theirs."""
        most = len(self.models) - 1
        return round(most * min(max((position - self.first) / (self.last - self.first), 0.0), 1.0))


def stroke_models(
    plant: Plant,
    quantity: str,
    actuator: str,
    commands: tuple[float, float],
    reach: tuple[float, float],
    directions: tuple[str, ...],
    period: float,
) -> Stroke:
    """Local models over a stroke.

    Args:
        plant: the nominal plant.
        quantity: what is followed: `extension`, `rotation` or `contraction`; counted from where
            the plant rests at `commands`.
        actuator: `motor` or `regulator`: whose voltage moves it; the other's stays.
        commands: motor and regulator voltage at the trial's begin (V).
        reach: lowest and highest position of the stroke (m or rad).
        directions: `relaxing`, `contracting` or both: the models are their mean.
        period: control period (s).
    Returns:
        The models over as much of the reach as voltages of 0-10 V hold.
    """
    rests, positions = _rests(plant, quantity, actuator, commands, reach)
    systems = [
        [linearize_at(plant, *rest, direction) for rest in rests] for direction in directions
    ]
    sensor = plant.model.parameters.get(SIGNALS[quantity].sensor)
    rate = 2.0 * math.pi * sensor.bandwidth if sensor is not None else None
    sampled = [
        [_sampled(system, quantity, actuator, rate, period) for system in row] for row in systems
    ]
    order = max(_order(system) for row in sampled for system in row)
    forms = [[observer_form(_reduced(one, order)) for one in row] for row in sampled]
    coefficients = np.mean(forms, axis=0)
    slopes = [_pressure_slope(system, quantity, actuator) for system in systems[0]]
    volts = [commands[0 if actuator == "motor" else 1] for _, commands in rests]
    fine = np.linspace(positions[0], positions[-1], FINE)

    def mixed(column: Sequence[float]) -> list[float]:
        return np.interp(fine, positions, column).tolist()

    rows = np.transpose([mixed(column) for column in coefficients.T])
    models = tuple(_local(row, period) for row in rows)
    ends = float(fine[0]), float(fine[-1])
    return Stroke(*ends, models, tuple(mixed(volts)), tuple(mixed(slopes)))


def _pressure_slope(system: "control.StateSpace", quantity: str, actuator: str) -> float:
    """How the motor's voltage that holds a position changes with the pressure (V/Pa)."""
    if actuator == "regulator":
        return 0.0
    static = -np.asarray(system.C) @ np.linalg.lstsq(np.asarray(system.A), np.asarray(system.B))[0]
    position, pressure = (static[system.output_labels.index(n)] for n in (quantity, "pressure"))
    return float(-position[1] / pressure[1] / position[0])


def _rests(
    plant: Plant,
    quantity: str,
    actuator: str,
    commands: tuple[float, float],
    reach: tuple[float, float],
) -> tuple[list[tuple[Condition, tuple[float, float]]], np.ndarray]:
    """The plant at rest at places of the reach with its voltages there, and the places."""
    motor, regulator = actuator == "motor", actuator == "regulator"

    def rest(volts: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        other = np.ones_like(volts)
        states, zeros = equilibria_at(
            plant,
            volts if motor else commands[0] * other,
            volts if regulator else commands[1] * other,
        )
        seen = plant.observe(states, 0.0)
        seen["extension"] = zeros - seen["contraction"]
        return states, zeros, seen[quantity]

    begin = float(rest(np.array([commands[0] if motor else commands[1]]))[2][0])
    searched = np.linspace(0.0, VOLTAGE_LIMIT, _SEARCHED)
    rising = _rising(rest(searched)[2] - begin, lowest=0.0 if motor else -np.inf)
    volts, rests = searched[rising[0]], rising[1]
    places = np.linspace(max(reach[0], float(rests[0])), min(reach[1], float(rests[-1])), PLACES)
    volts = np.interp(places, rests, volts)
    states, zeros, positions = rest(volts)
    rests = [
        (
            Condition(state, float(zero)),
            (float(v), commands[1]) if motor else (commands[0], float(v)),
        )
        for state, zero, v in zip(states, zeros, volts, strict=True)
    ]
    return rests, positions - begin


def _rising(positions: np.ndarray, lowest: float) -> tuple[np.ndarray, np.ndarray]:
    """Where positions by voltage are known, above a lowest one and rise; and those positions.

    A slack cable holds nothing, nor does a muscle at its end; a quadratic map turns back.
    """
    best, kept = lowest, []
    for at, position in enumerate(positions.tolist()):
        if position > best:
            best = position
            kept.append(at)
    return np.array(kept), positions[kept]


def _sampled(
    system: "control.StateSpace", quantity: str, actuator: str, rate: float | None, period: float
) -> System:
    """Plant and sensor of a rate (1/s), sampled, the voltage held over each period."""
    at = system.input_labels.index(f"{actuator}_voltage")
    a, b = np.asarray(system.A), np.asarray(system.B)[:, at]
    c = np.asarray(system.C)[system.output_labels.index(quantity)]
    if rate is not None:
        a = np.block([[a, np.zeros((len(a), 1))], [rate * c, -rate]])
        b, c = np.append(b, 0.0), np.append(0.0 * c, 1.0)
    # exp of [[A, B], [0, 0]] T holds both matrices of the sampled system.
    n = len(a)
    whole = expm(period * np.block([[a, b[:, None]], [np.zeros((1, n + 1))]]))
    return whole[:n, :n], whole[:n, n], c


def _reduced(system: System, order: int) -> System:
    """A sampled system by balanced truncation, its static gain kept."""
    a, b, c = system
    reach, watch = _root(_gramian(a, b)), _root(_gramian(a.T, c))
    left, singular, right = np.linalg.svd(watch.T @ reach)
    scale = 1.0 / np.sqrt(singular[:order])
    into, out = (scale[:, None] * left.T[:order]) @ watch.T, reach @ right[:order].T * scale
    a_r, b_r, c_r = into @ a @ out, into @ b, c @ out
    return a_r, b_r * (_gain(a, b, c) / _gain(a_r, b_r, c_r)), c_r


def _gramian(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Sum of A^k b b' A'^k over 2^14 steps, by doubling.

    Not from the Lyapunov equation: a rotor that no cable pulls at makes that singular, although
    nothing reaches it.
    """
    total = np.outer(b, b)
    for _ in range(14):
        total, a = total + a @ total @ a.T, a @ a
    return total


def _root(gramian: np.ndarray) -> np.ndarray:
    """R with R R' = a Gramian, which rounding may leave with tiny negative eigenvalues."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _gain(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    # Not by solving: a rotor that no cable pulls at makes the matrix singular, but is not reached.
    return float(c @ np.linalg.lstsq(np.eye(len(a)) - a, b)[0])


def _order(system: System) -> int:
    """The lowest order whose step response is the full one's."""
    full = step_response(*system)
    for order in range(1, LARGEST_ORDER):
        off = np.abs(step_response(*_reduced(system, order)) - full).max()
        if off <= LARGEST_ERROR * abs(_gain(*system)):
            return order
    return LARGEST_ORDER


def step_response(a: np.ndarray, b: np.ndarray, c: np.ndarray, steps: int = 60) -> np.ndarray:
    """Position after 1, 2... steps of 1 V, shape (steps,)."""
    x, response = np.zeros(len(b)), []
    for _ in range(steps):
        x = a @ x + b
        response.append(float(c @ x))
    return np.array(response)


def observer_form(system: System) -> np.ndarray:
    """a_1 ... a_n, b_1 ... b_n of a sampled system of n states, shape (2 n,)."""
    a, b, c = system
    order = len(b)
    denominator = np.real(np.poly(a))
    # The impulse response c b, c A b... times the denominator is the numerator.
    response = [float(c @ np.linalg.matrix_power(a, k) @ b) for k in range(order)]
    return np.concatenate([denominator[1:], np.convolve(denominator, response)[:order]])


def _local(coefficients: np.ndarray, period: float) -> LocalModel:
    n = len(coefficients) // 2
    a = np.eye(n, k=1)
    a[:, 0] = -coefficients[:n]
    b, c = coefficients[n:].copy(), np.eye(n)[0]
    slowest = float(np.abs(np.linalg.eigvals(a)).max())
    gain = float(coefficients[n:].sum() / (1.0 + coefficients[:n].sum()))
    return LocalModel(a, b, c, gain, -period / math.log(slowest))
