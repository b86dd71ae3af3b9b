"""Equilibrium of a station: the contraction at which the muscle balances cable and drive."""

from collections.abc import Callable

import numpy as np

from pma_gym.effects.cable.hanging_load import GRAVITY
from pma_gym.effects.effect import signals
from pma_gym.plant.equilibrium.problem import EquilibriumProblem, SolvablePlant

RIPPLE = "drive_ripple"
"""Port whose effects make the load depend on the motor's angle."""

_CLEAR_M, _NEAR_RAD, _MOST_APPROACHES = 1e-3, 1e-13, 100
"""Slack (m) at which a drive's load is known without the cable; tolerance of the angle, and largest
number of iterations."""


def solve_station(problem: EquilibriumProblem) -> None:
    """Solve for a station's contraction and angle at which muscle, cable and drive balance."""
    problem.zero[:] = _balance(problem, np.zeros(len(problem.state)))
    problem["contraction"] = problem.zero
    # With the zero at the contraction itself the cable is slack: the rotor shows the drive's load.
    load = _drive_load(problem)
    problem["contraction"] = _balance(problem, np.maximum(load, 0.0))
    problem["angle"] = np.where(load > 0.0, _taut_angles(problem, load), 0.0)
    ripples = [e for e in problem.plant.effects.values() if e.port == RIPPLE and e.law]
    angles = {"angle", "motor_angle"}
    if any(angles & set(signals(effect.law)) for effect in ripples if effect.law):
        _settle_by_angle(problem)


def _drive_load(problem: EquilibriumProblem) -> np.ndarray:
    """Load of the drive (N), which the pulley shows while the cable hangs slack."""
    rotor, pull = problem.parameters("rotor"), problem.rate("spin")
    effects, inertia = problem.plant.effects, rotor["inertia"]
    if "leg" in effects:
        inertia = inertia + problem.parameters("leg")["inertia"]
    if "hanging_load" not in effects:
        return pull * inertia / rotor["radius"]
    # The load is what accelerates rotor and weights, whose mass is the load's: L - M a = J a / r^2.
    share = problem.parameters("hanging_load")["share"] * rotor["radius"] * pull / GRAVITY
    return pull * inertia / (rotor["radius"] * (1.0 - share))


def _settle_by_angle(problem: EquilibriumProblem) -> None:
    """Iterate contractions and angles until the loads at the angles balance.

    The relaxation factor follows from the last change (Wegstein 1958). Rows stop independently.
    """
    rotor = problem.parameters("rotor")
    angle, contraction = problem["angle"].copy(), problem["contraction"].copy()
    done = np.zeros(angle.shape, bool)
    before, asked = np.full((2, *angle.shape), np.nan)
    for _ in range(_MOST_APPROACHES):
        problem["angle"] = angle
        problem["contraction"] = problem.zero - rotor["radius"] * angle - _CLEAR_M
        load = _drive_load(problem)
        problem["angle"] = 0.0
        problem["contraction"] = _balance(problem, np.maximum(load, 0.0))
        taut = np.where(load > 0.0, _taut_angles(problem, load), 0.0)
        near = ~(np.abs(taut - angle) > _NEAR_RAD)
        contraction = np.where(done, contraction, problem["contraction"])
        with np.errstate(invalid="ignore", divide="ignore"):
            share = (angle - before) / (angle - before - (taut - asked))
        share = np.where(np.isfinite(share), np.clip(share, 0.2, 2.0), 0.5)
        before, asked = angle, taut
        angle = np.where(done, angle, np.where(near, taut, angle + share * (taut - angle)))
        done = done | near
        if np.all(done):
            break
    if not np.all(done):
        problem.unbalanced = problem.unbalanced or (
            "a ripple of the motor changes the load faster with its angle than the muscle can "
            "hold, so that no rest is found; make the ripple's amplitude or periods a turn smaller"
        )
        contraction = np.where(done, contraction, np.nan)
    problem["angle"], problem["contraction"] = angle, contraction


def _balance(problem: EquilibriumProblem, loads: np.ndarray) -> np.ndarray:
    """Contractions (m) at which the muscles balance loads (N); NaN where none does."""
    limits = problem.parameters("limits")
    low, high = -2.0 * limits["stretch"], 2.0 * limits["contraction"]
    at_low, at_high = problem.force(low), problem.force(high)
    contraction = balances(problem.plant, problem["pressure"], loads, problem.vectors)
    contraction = np.where((loads == 0.0) & (at_low == 0.0) & (at_high == 0.0), 0.0, contraction)
    outside = ~((at_low - loads) * (at_high - loads) <= 0.0)
    if np.any(outside):
        ends = np.broadcast_to(1e3 * low, outside.shape), np.broadcast_to(1e3 * high, outside.shape)
        numbers = [column[outside][0] for column in (*ends, loads, at_low, at_high)]
        problem.unbalanced = problem.unbalanced or (
            "no contraction between {:g} and {:g} mm balances a load of {:.4g} N (the muscle gives "
            "{:.4g} to {:.4g} N there); lower the first motor voltage or raise the pressure"
        ).format(*numbers)
    return np.where(outside, np.nan, contraction)


def balances(
    plant: SolvablePlant,
    pressures: np.ndarray,
    loads: np.ndarray,
    vectors: np.ndarray | None = None,
) -> np.ndarray:
    """Contraction (m) at which the muscle balances each load (N) at each pressure (Pa).

    Args:
        plant: a station.
        pressures: shape (n,).
        loads: shape (n,).
        vectors: parameters of each, shape (n, numbers); the plant's own if not given.
    Returns:
        Shape (n,); an end of the search range (twice the limits) where there is no balance.
    """
    pressures, loads = np.ascontiguousarray(pressures, float), np.ascontiguousarray(loads, float)
    numbers = plant.vector if vectors is None else np.ascontiguousarray(vectors, float)
    stride = 0 if vectors is None else numbers.shape[1]
    out = np.empty(len(pressures))
    addresses = (a.ctypes.data for a in (pressures, loads, numbers))
    plant.program.balance(len(out), *addresses, stride, out.ctypes.data)
    return out


def static_force(plant: SolvablePlant, state: np.ndarray) -> Callable[[float], float]:
    """Force of the muscle (N) over contraction (m), at the state's pressure, without the cable."""
    mass = plant.parameters["slide"].mass
    probe = state.copy()
    x, velocity = plant.states.index("contraction"), plant.states.index("velocity")

    def force(contraction: float) -> float:
        # With the zero at the contraction itself the cable is slack.
        probe[x] = contraction
        return float(mass * plant.derivative(probe, 0.0, 0.0, contraction)[velocity])

    return force


def _taut_angles(problem: EquilibriumProblem, loads: np.ndarray) -> np.ndarray:
    """Angles at which the cables carry the loads (N) that the drives ask for."""
    rotor, cable = problem.parameters("rotor"), problem.parameters("cable")
    extension = problem.zero - problem["contraction"]

    def torque(angles: np.ndarray) -> np.ndarray:
        problem["angle"] = angles
        return problem.rate("spin")

    furthest = extension + cable["slack"] + 2.0 * loads / cable["stiffness"]
    return roots(torque, extension / rotor["radius"], furthest / rotor["radius"])


_MOST_SECANTS = 200


def roots(
    function: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Zeros of a function that falls between two ends: regula falsi that halves what stands still.

    Each row stops independently, so that its bits do not depend on the others.
    """
    at_low, at_high = function(low), function(high)
    root, done = high, np.zeros(low.shape, bool)
    for _ in range(_MOST_SECANTS):
        with np.errstate(invalid="ignore", divide="ignore"):
            middle = high - at_high * (high - low) / (at_high - at_low)
        middle = np.where((middle >= low) & (middle <= high), middle, 0.5 * (low + high))
        value = function(middle)
        near = np.abs(middle - root) <= 1e-15 + 1e-14 * np.abs(middle)
        root = np.where(done, root, middle)
        done = done | near | ~(value != 0.0) | np.isnan(value)
        if np.all(done):
            break
        above = value > 0.0
        # An end that stays where it is counts half the next time.
        at_high = np.where(above, 0.5 * at_high, value)
        at_low = np.where(above, value, 0.5 * at_low)
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return root
