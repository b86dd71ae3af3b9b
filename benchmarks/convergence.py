"""Order of convergence of the integrator, on a trial without a kink."""

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant

SMOOTH = {
    "coulomb_friction.static_n": 0.0,
    "coulomb_friction.dynamic_n": 0.0,
    "damping.high_slope_n_s_per_mm_per_kpa": 0.0,
}


def smooth_errors(damping_n_s_per_mm: float, steps: NDArray) -> NDArray:
    """Errors of contraction and angle under a quickly swinging motor, no kink anywhere.

    Args:
        damping_n_s_per_mm: the same in both directions (N s/mm).
        steps: integration steps (s), shape (n,).
    Returns:
        Absolute errors (m, rad) against DOP853 at rtol 1e-12, shape (n, 2).
    """
    both = {
        f"damping.{name}_n_s_per_mm": damping_n_s_per_mm
        for name in ("contracting", "relaxing", "high_intercept")
    }
    model = load_model("sarosi").replace(SMOOTH | both)
    plant = Plant(model, steps[0])
    start, regulator = plant.settle(4.0, 400e3), plant.regulator_voltage(400e3)
    # Joined linearly and stepped through node by node: the corners are never inside a step.
    nodes = np.linspace(0.0, 0.2, 51)
    motor = 4.0 + 0.5 * np.sin(60.0 * nodes)

    def rate(time: float, state: NDArray) -> NDArray:
        voltage = float(np.interp(time, nodes, motor))
        return plant.derivative(state, voltage, regulator, start.zero_contraction)

    state = start.state
    for begin, end in zip(nodes[:-1], nodes[1:], strict=True):
        state = solve_ivp(rate, (begin, end), state, "DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
    errors = []
    for step in steps:
        plant.step_limit = step
        states, _ = plant.run(nodes, motor, np.full(51, regulator), condition=start)
        errors.append(np.abs(states[-1] - state)[[0, 2]])
    return np.array(errors)


def orders(damping_n_s_per_mm: float, steps: NDArray) -> tuple[NDArray, NDArray]:
    """Errors, and the order between each step and the next half as large, shape (n - 1, 2)."""
    errors = smooth_errors(damping_n_s_per_mm, steps)
    return errors, np.log2(errors[:-1] / errors[1:])
