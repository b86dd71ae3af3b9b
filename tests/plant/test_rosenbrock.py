"""The Rosenbrock method: its coefficients, its order, and its stability."""

import numpy as np
import pytest

from benchmarks.convergence import FixedStep, orders, smooth_plant
from benchmarks.methods import GRK4T, RODAS4, ROS4L
from pma_gym.kernels.graph import CHANGING, Graph
from pma_gym.kernels.text import evaluate
from pma_gym.plant.compose import State
from pma_gym.plant.elimination import solver
from pma_gym.plant.rosenbrock import VELDHUIZEN, step

METHODS = {
    "van Veldhuizen": VELDHUIZEN,
    "GRK4T": GRK4T,
    "ROS4 (L-stable)": ROS4L,
    "Rodas4": RODAS4,
}


def matrices(method):
    """alpha, beta, weights and embedded weights, from the form without products with J.

    With u = Gamma k: C = 1 / gamma - Gamma^-1, a = alpha Gamma^-1, m = b Gamma^-1
    (Hairer and Wanner, Eq. IV.7.25).
    """
    count = len(method.weights)
    couplings, stages = np.zeros((2, count, count))
    last = ()
    for i, (own, coupling) in enumerate(zip(method.stages, method.couplings, strict=True)):
        last = last if own is None else own
        stages[i, : len(last)] = last
        couplings[i, : len(coupling)] = coupling
    gamma = np.linalg.inv(np.eye(count) / method.gamma - couplings)
    alpha = stages @ gamma
    weights = np.array(method.weights) @ gamma
    embedded = weights - np.array(method.errors) @ gamma
    return alpha, alpha + gamma, weights, embedded


def conditions(alpha, beta, b, order):
    """Left and right sides of the order conditions (Hairer and Wanner, table IV.7.1)."""
    one, a = np.ones(len(b)), alpha.sum(axis=1)
    row = beta @ one
    found = [(b @ one, 1.0), (b @ row, 1 / 2), (b @ a**2, 1 / 3), (b @ beta @ row, 1 / 6)]
    if order == 4:
        found += [
            (b @ a**3, 1 / 4),
            (b @ (a * (alpha @ row)), 1 / 8),
            (b @ beta @ a**2, 1 / 12),
            (b @ beta @ beta @ row, 1 / 24),
        ]
    return found


@pytest.mark.parametrize("name", METHODS)
def test_the_coefficients_meet_the_conditions_of_order_four_and_three(name):
    alpha, beta, weights, embedded = matrices(METHODS[name])
    for found, expected in conditions(alpha, beta, weights, 4):
        assert found == pytest.approx(expected, abs=1e-9)
    for found, expected in conditions(alpha, beta, embedded, 3):
        assert found == pytest.approx(expected, abs=1e-9)
    # The embedded one is of order 3 and no more, or it would see no error.
    worst = max(abs(f - e) for f, e in conditions(alpha, beta, embedded, 4))
    assert worst > 1e-3


def test_no_stage_reaches_beyond_the_step():
    # Switches end steps before a kink: no rate from the other side may count.
    alpha, *_ = matrices(VELDHUIZEN)
    assert np.all(alpha.sum(axis=1) <= 1.0)


def growth(method, z):
    """The stability function R(z)."""
    _, beta, weights, _ = matrices(method)
    count = len(weights)
    return 1.0 + z * weights @ np.linalg.solve(np.eye(count) - z * beta, np.ones(count))


@pytest.mark.parametrize("name", ["ROS4 (L-stable)", "Rodas4"])
def test_the_others_damp_what_is_fast_entirely(name):
    # The gamma of ROS4 is printed with five digits.
    assert abs(growth(METHODS[name], -1e9)) < 1e-4
    assert max(abs(growth(METHODS[name], 1j * size)) for size in np.logspace(-2, 6, 400)) <= 1.0


def test_it_is_stable_up_to_89_4_degrees_and_damps_what_is_fast():
    sizes = np.logspace(-3, 8, 2001)
    for degrees in (0.0, 45.0, 80.0, 89.0, 89.4):
        direction = -np.exp(1j * np.radians(degrees))
        assert max(abs(growth(VELDHUIZEN, size * direction)) for size in sizes) <= 1.0
    assert abs(growth(VELDHUIZEN, -1e12)) == pytest.approx(0.242, abs=1e-3)
    # An oscillation without any damping is let grow a little by long steps: 2.3 % at worst.
    on_axis = max(abs(growth(VELDHUIZEN, 1j * size)) for size in sizes)
    assert 1.02 < on_axis < 1.03


def predator_and_prey():
    """A smooth system without a closed form: prey, predators, and their first integral."""
    graph = Graph()
    x, y, size = (graph.input(name, CHANGING) for name in ("x", "y", "size"))
    states = [State("x", x, x * (1.0 - y), 1.0), State("y", y, y * (x - 1.0), 1.0)]
    return step(states, size, {}, {}), size


def marched(made, state, duration, count):
    for _ in range(count):
        given = {"x": state[0], "y": state[1], "size": duration / count}
        state = [float(v) for v in evaluate(made.states, given)]
    return np.array(state)


def test_order_four_on_predator_and_prey():
    made, _ = predator_and_prey()
    start, duration = [2.0, 1.5], 2.0
    exact = marched(made, start, duration, 2048)
    errors = [np.abs(marched(made, start, duration, n) - exact).max() for n in (16, 32, 64, 128)]
    found = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all((3.7 < found) & (found < 4.5))


def test_the_estimate_is_the_error_of_order_three():
    made, _ = predator_and_prey()
    sizes = 0.2 * 0.5 ** np.arange(5)
    estimates, truths = [], []
    for size in sizes:
        given = {"x": 2.0, "y": 1.5, "size": size}
        estimates.append(max(abs(float(e)) for e in evaluate(made.errors, given)))
        fine = marched(made, [2.0, 1.5], size, 64)
        own = np.array([float(v) for v in evaluate(made.states, given)])
        truths.append(np.abs(own - fine).max())
    # In one step: h^4 of the method of order 3, h^5 of order 4.
    assert np.log2(np.divide(estimates[:-1], estimates[1:]))[-2:] == pytest.approx(4.0, abs=0.1)
    assert np.log2(np.divide(truths[:-1], truths[1:]))[-2:] == pytest.approx(5.0, abs=0.4)
    assert np.all(np.array(truths) < estimates)


@pytest.mark.parametrize("rate", [1.0, 1e3, 1e8])
def test_what_is_linear_decays_whatever_its_rate(rate):
    graph = Graph()
    x, size = graph.input("x", CHANGING), graph.input("size", CHANGING)
    made = step([State("x", x, -rate * x, 1.0)], size, {}, {})
    (after,) = evaluate(made.states, {"x": 1.0, "size": 0.1})
    assert float(after) == pytest.approx(growth(VELDHUIZEN, -0.1 * rate).real, abs=1e-10)
    assert abs(float(after)) <= 1.0


@pytest.mark.parametrize("damping", [0.05, 2.9, 14.5])
def test_order_four_on_the_plant(damping):
    # 14.5 N s/mm is 29 000 1/s of damping over mass: 23 times these steps, and no loss of order.
    errors, found = orders(damping, np.array([8e-4, 4e-4, 2e-4]))
    assert np.all((3.8 < found) & (found < 4.2))
    assert errors[0].max() < 1e-8


def test_the_plants_estimate_is_of_order_three():
    plant = smooth_plant(2.9)
    rest, regulator = plant.settle(4.0, 400e3), plant.regulator_voltage(400e3)
    fixed = FixedStep(plant)
    estimates = []
    for size in 4e-4 * 0.5 ** np.arange(4):
        _, errors = fixed(rest.state, (4.5, 0.0), (regulator, 0.0), rest.zero_contraction, size)
        estimates.append(abs(errors[plant.states.index("spin")]))
    found = np.log2(np.divide(estimates[:-1], estimates[1:]))
    assert np.all((3.8 < found) & (found < 4.5))


def test_elimination_solves_what_numpy_solves():
    generator = np.random.default_rng(2)
    for _ in range(20):
        graph, count = Graph(), 7
        part = float(10.0 ** generator.uniform(-7.0, 0.0))
        numbers = 0.3 * generator.standard_normal((count, count)) / count / part
        full = generator.uniform(size=(count, count)) < 0.4
        jacobian = [
            [graph.input(f"{i},{j}", CHANGING) if full[i, j] else None for j in range(count)]
            for i in range(count)
        ]
        right = [graph.input(f"{i}", CHANGING) if i % 3 else None for i in range(count)]
        solution = solver(jacobian, graph.input("part", CHANGING))(right)
        values = generator.standard_normal(count)
        given = {f"{i},{j}": numbers[i, j] for i in range(count) for j in range(count)}
        given |= {f"{i}": values[i] for i in range(count)} | {"part": part}
        matrix = np.eye(count) / part - np.where(full, numbers, 0.0)
        expected = np.linalg.solve(matrix, np.where(np.arange(count) % 3 > 0, values, 0.0))
        found = [float(v) for v in evaluate(solution, given)]
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14 * part)
