"""Order of convergence of the integrator's steps, on a trial without a kink.

Nobody can command the size of a plant's internal steps. Here the very arithmetic of a step, without
its choice of size, is written as plain Python and integrated with sizes that are given.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from pma_gym.codegen.graph import CHANGING
from pma_gym.codegen.text import python_text
from pma_gym.codegen.trace import live_inputs, substitute
from pma_gym.integrator.equations import COMMANDS, ZERO
from pma_gym.integrator.exponential_rosenbrock import Step, step
from pma_gym.integrator.step_attempt import step_start
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import parameter_names

SMOOTH = {
    "coulomb_friction.static_n": 0.0,
    "coulomb_friction.dynamic_n": 0.0,
    "damping.high_slope_n_s_per_mm_per_kpa": 0.0,
}

SIZES_S = (4e-3, 2e-3, 1e-3, 5e-4)
"""Sizes of the steps that the order is read from (s)."""


class FixedStep:
    """A plant's step of a given size, under commands that change linearly in time.

    Args:
        plant: the plant.
        method: what makes the step.

    Attributes:
        text: the function as Python.
    """

    def __init__(self, plant: Plant, method: Callable[..., Step] = step) -> None:
        self.plant = plant
        eq = plant.program.first_order_hold.equations
        frozen, here = step_start(eq)
        made = method(eq.states, eq.graph.input("step_size", CHANGING), frozen, here)
        moved = {s.value.id: new for s, new in zip(eq.states, made.states, strict=True)}
        after = substitute([path.after for path in eq.rate_independent_states], {**frozen, **moved})
        names = [entry.name for entry in (*eq.states, *eq.rate_independent_states)]
        by_name = dict(zip(names, [*made.states, *after], strict=True))
        errors = dict(zip((s.name for s in eq.states), made.errors, strict=True))
        outputs = [by_name[name] for name in plant.states]
        outputs += [errors.get(name, eq.graph.constant(0.0)) for name in plant.states]
        inputs = live_inputs(outputs)
        self.text = python_text(outputs, inputs, "fixed_step")
        self._arguments = [value.data for value in inputs]
        fixed = ["tolerance", *parameter_names(plant.model)]
        self._fixed = dict(zip(fixed, map(float, plant.vector), strict=True))
        module: dict[str, Callable[..., tuple]] = {}
        exec(compile(self.text, "<fixed_step>", "exec"), module)
        self._function = module["fixed_step"]

    def __call__(
        self,
        state: NDArray,
        motor: tuple[float, float],
        regulator: tuple[float, float],
        zero: float,
        size: float,
    ) -> tuple[NDArray, NDArray]:
        """One step.

        Args:
            state: state vector (SI).
            motor: motor voltage (V) at the beginning, and its slope (V/s).
            regulator: the same of the regulator.
            zero: contraction x0 that the trial began at with no load (m).
            size: size of the step (s).
        Returns:
            The state vector after it, and the estimated error of each state.
        """
        known = self._fixed | dict(zip(self.plant.states, map(float, state), strict=True))
        known |= {ZERO: zero, "step_size": size}
        for name, (value, slope) in zip(COMMANDS, (motor, regulator), strict=True):
            known |= {name: value, f"{name}_slope": slope}
        values = np.array(self._function(*(known[name] for name in self._arguments)))
        return values[: len(state)], values[len(state) :]


def smooth_plant(damping_n_s_per_mm: float) -> Plant:
    """A station without friction, with a damping that is the same in both directions (N s/mm)."""
    both = {
        f"damping.{name}_n_s_per_mm": damping_n_s_per_mm
        for name in ("contracting", "relaxing", "high_intercept")
    }
    return Plant(load_model("sarosi").replace(SMOOTH | both))


def smooth_errors(damping_n_s_per_mm: float, sizes: NDArray) -> NDArray:
    """Errors of contraction and angle under a quickly swinging motor, no kink anywhere.

    Args:
        damping_n_s_per_mm: the same in both directions (N s/mm).
        sizes: sizes of the steps (s), shape (n,), each a whole share of 4 ms.
    Returns:
        Absolute errors (m, rad) against DOP853 at rtol 1e-12, shape (n, 2).
    """
    plant = smooth_plant(damping_n_s_per_mm)
    start, regulator = plant.settle(4.0, 400e3), plant.regulator_voltage(400e3)
    zero = start.zero_contraction
    # Joined linearly and stepped through node by node: the corners are never inside a step.
    nodes = np.linspace(0.0, 0.2, 51)
    motor = 4.0 + 0.5 * np.sin(60.0 * nodes)

    def rate(time: float, state: NDArray) -> NDArray:
        return plant.derivative(state, float(np.interp(time, nodes, motor)), regulator, zero)

    exact = start.state
    for begin, end in zip(nodes[:-1], nodes[1:], strict=True):
        exact = solve_ivp(rate, (begin, end), exact, "DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
    fixed, errors = FixedStep(plant), []
    for size in sizes:
        count, state = round((nodes[1] - nodes[0]) / size), start.state
        for first, last in zip(motor[:-1], motor[1:], strict=True):
            slope = (last - first) / (count * size)
            for k in range(count):
                now = float(first + slope * k * size)
                state, _ = fixed(state, (now, float(slope)), (regulator, 0.0), zero, float(size))
        errors.append(np.abs(state - exact)[[0, 2]])
    return np.array(errors)


def orders(damping_n_s_per_mm: float, sizes: NDArray) -> tuple[NDArray, NDArray]:
    """Errors, and the order between each size and the next half as large, shape (n - 1, 2)."""
    errors = smooth_errors(damping_n_s_per_mm, sizes)
    return errors, np.log2(errors[:-1] / errors[1:])
