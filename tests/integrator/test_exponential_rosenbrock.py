"""The exponential Rosenbrock method: its quotients, its order, and its stability.

The order is that of a smooth system without a closed form, and of a plant without a kink.
Nobody can command the size of a plant's internal steps. Here the very arithmetic of a step, without
its choice of size, is written as plain Python and integrated with sizes that are given.
"""

from collections.abc import Callable
from fractions import Fraction
from math import factorial

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.text import evaluate, python_text
from pma_gym.codegen.trace import live_inputs, substitute
from pma_gym.integrator.equations import COMMANDS, ZERO, State
from pma_gym.integrator.exponential_rosenbrock import (
    BENT_PHI,
    GAMMA,
    HALF_PHI,
    LINEAR_SHARE,
    PHI,
    STAGE,
    STAGE_PHI,
    TERMS,
    Step,
    step,
)
from pma_gym.integrator.step_attempt import step_start
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import parameter_names

SMOOTH = {
    "coulomb_friction.static_n": 0.0,
    "coulomb_friction.dynamic_n": 0.0,
    "damping.high_slope_n_s_per_mm_per_kpa": 0.0,
}


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
        outputs = [by_name[name] for name in plant.states]
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
    ) -> NDArray:
        """One step.

        Args:
            state: state vector (SI).
            motor: motor voltage (V) at the beginning, and its slope (V/s).
            regulator: the same of the regulator.
            zero: contraction x0 that the trial began at with no load (m).
            size: size of the step (s).
        Returns:
            The state vector after it.
        """
        known = self._fixed | dict(zip(self.plant.states, map(float, state), strict=True))
        known |= {ZERO: zero, "step_size": size}
        for name, (value, slope) in zip(COMMANDS, (motor, regulator), strict=True):
            known |= {name: value, f"{name}_slope": slope}
        return np.array(self._function(*(known[name] for name in self._arguments)))


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
                state = fixed(state, (now, float(slope)), (regulator, 0.0), zero, float(size))
        errors.append(np.abs(state - exact)[[0, 2]])
    return np.array(errors)


def orders(damping_n_s_per_mm: float, sizes: NDArray) -> tuple[NDArray, NDArray]:
    """Errors, and the order between each size and the next half as large, shape (n - 1, 2)."""
    errors = smooth_errors(damping_n_s_per_mm, sizes)
    return errors, np.log2(errors[:-1] / errors[1:])


START = (2.0, 1.5)
"""Prey and predators."""


def predator_and_prey(step: Callable[..., Step]) -> Step:
    """A step of prey and predators."""
    graph = Graph()
    x, y, size = (graph.input(name, CHANGING) for name in ("x", "y", "size"))
    states = [State("x", x, x * (1.0 - y), 1.0), State("y", y, y * (x - 1.0), 1.0)]
    return step(states, size, {}, {})


def integrated(made: Step, duration: float, count: int) -> NDArray[np.float64]:
    """Both after some steps from the start."""
    state = list(START)
    for _ in range(count):
        given = {"x": state[0], "y": state[1], "size": duration / count}
        state = [float(value) for value in evaluate(made.states, given)]
    return np.array(state)


def smooth_orders(made: Step) -> NDArray[np.float64]:
    """Orders of convergence from 16 to 128 steps."""
    exact = integrated(made, 2.0, 2048)
    errors = [np.abs(integrated(made, 2.0, count) - exact).max() for count in (16, 32, 64, 128)]
    return np.log2(np.divide(errors[:-1], errors[1:]))


def in_one_step(made: Step) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimated and true errors of one step, ever half as long."""
    estimates, truths = [], []
    for size in 0.2 * 0.5 ** np.arange(5):
        given = {"x": START[0], "y": START[1], "size": size}
        estimates.append(max(abs(float(error)) for error in evaluate(made.errors, given)))
        own = np.array([float(value) for value in evaluate(made.states, given)])
        truths.append(np.abs(own - integrated(made, size, 64)).max())
    return np.array(estimates), np.array(truths)


POLE = float(GAMMA)


def phi(order, z):
    """phi_order(z) by its power series."""
    return sum(z**j / factorial(j + order) for j in range(40))


def quotient(terms, z):
    """sum_k b_k S^k W of a number z."""
    w = 1.0 / (1.0 - POLE * z)
    return POLE * w * sum(b * (w - 1.0) ** k for k, b in enumerate(terms))


@pytest.mark.parametrize(
    ("terms", "truth"),
    [
        (PHI, lambda z: phi(1, z)),
        (STAGE_PHI, lambda z: 0.75 * phi(1, 0.75 * z)),
        (HALF_PHI, lambda z: 0.5 * phi(1, 0.5 * z)),
        (BENT_PHI, lambda z: 32 / 9 * phi(3, z)),
    ],
)
def test_a_quotient_is_its_function_to_as_many_powers_as_it_has_terms(terms, truth):
    sizes = np.array([0.2, 0.1, 0.05]) * np.exp(2.0j)
    errors = np.abs([quotient(terms, z) - truth(z) for z in sizes])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(len(terms), abs=0.2)


def growth(z):
    """What a step makes of exp(z)."""
    return 1.0 + z * quotient(PHI, z)


def test_the_error_of_the_exponential():
    for z in (0.1, 0.1j, -0.1):
        assert abs(growth(z) - np.exp(z)) == pytest.approx(1.4e-5 * 0.1**7, rel=0.1)


def test_it_is_stable_up_to_84_degrees_and_damps_what_is_fast():
    sizes = np.logspace(-3, 8, 2001)
    for degrees in (0.0, 45.0, 60.0, 80.0, 84.0):
        direction = -np.exp(1j * np.radians(degrees))
        assert np.abs(growth(sizes * direction)).max() <= 1.0
    assert abs(growth(-1e12)) == pytest.approx(0.457, abs=1e-3)
    # An oscillation without any damping is let grow by steps that are too long for it.
    assert 1.2 < np.abs(growth(1j * sizes)).max() < 1.3


def test_the_stage_overshoots_nothing_that_is_fast():
    # Less than twice the way to where it comes to rest, and nearly there at h rate = 5.
    assert abs(1.0 - 1e12 * quotient(STAGE_PHI, -1e12)) < 2.0
    assert abs(1.0 - 5.0 * quotient(STAGE_PHI, -5.0)) < 0.1
    assert Fraction(0) < STAGE < 1


def test_order_four_on_predator_and_prey():
    orders_seen = smooth_orders(predator_and_prey(step))
    assert np.all((3.7 < orders_seen) & (orders_seen < 4.5))


def test_the_estimate_is_of_order_two_and_larger_than_the_error():
    estimates, truths = in_one_step(predator_and_prey(step))
    # In one step: h^3 of what is not linear, h^5 of order 4.
    assert np.log2(estimates[:-1] / estimates[1:])[-2:] == pytest.approx(3.0, abs=0.1)
    assert np.log2(truths[:-1] / truths[1:])[-2:] == pytest.approx(5.0, abs=0.4)
    assert np.all(5.0 * truths < estimates)


def test_half_a_step_is_known_on_the_way():
    made = predator_and_prey(step)
    errors = []
    for size in (0.1, 0.05, 0.025):
        half = evaluate(made.visited[0], {"x": 2.0, "y": 1.5, "size": size})
        truth = integrated(made, 0.5 * size, 64)
        errors.append(np.abs(np.array([float(v) for v in half]) - truth).max())
    # Without what is not linear: h^3.
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("rate", [1.0, 1e3, 1e8])
def test_what_is_linear_decays_whatever_its_rate(rate):
    graph = Graph()
    x, size = graph.input("x", CHANGING), graph.input("size", CHANGING)
    made = step([State("x", x, -rate * x, 1.0)], size, {}, {})
    (after,) = evaluate(made.states, {"x": 1.0, "size": 0.1})
    assert float(after) == pytest.approx(growth(-0.1 * rate), abs=1e-10)
    assert abs(float(after)) <= 1.0


def test_an_oscillation_is_exact_to_order_six():
    graph = Graph()
    x, v, size = (graph.input(name, CHANGING) for name in ("x", "v", "size"))
    made = step([State("x", x, v, 1.0), State("v", v, -x, 1.0)], size, {}, {})
    errors, estimates = [], []
    for length in (1.0, 0.5, 0.25):
        given = {"x": 1.0, "v": 0.0, "size": length}
        place, speed = (float(value) for value in evaluate(made.states, given))
        errors.append(np.hypot(place - np.cos(length), speed + np.sin(length)))
        there, faster = (float(error) for error in evaluate(made.errors, given))
        estimates.append(np.hypot(there, faster))
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(7.0, abs=0.2)
    assert np.log2(np.divide(estimates[:-1], estimates[1:])) == pytest.approx(TERMS, abs=0.4)
    assert LINEAR_SHARE < 1.0 and np.all(np.array(errors) < estimates)


@pytest.mark.parametrize("damping", [0.05, 2.9, 14.5])
def test_order_four_on_the_plant(damping):
    # 14.5 N s/mm is 29 000 1/s of damping over mass: 116 times these steps, and no loss of order.
    # Most of the plant is linear, and of order 6.
    errors, orders_seen = orders(damping, np.array([4e-3, 2e-3, 1e-3]))
    assert np.all(3.8 < orders_seen)
    assert errors[0].max() < 1e-6
