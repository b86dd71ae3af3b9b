"""The Rosenbrock methods to compare with: their coefficients, their order, and their stability."""

import numpy as np
import pytest

from benchmarks.methods import GRK4T, RODAS4, ROS4L
from benchmarks.rosenbrock import VELDHUIZEN, step
from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.text import evaluate
from pma_gym.integrator.equations import State
from tests.plant import smooth

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


def test_order_four_on_predator_and_prey():
    found = smooth.orders(smooth.predator_and_prey(step))
    assert np.all((3.7 < found) & (found < 4.5))


def test_the_estimate_is_the_error_of_order_three():
    estimates, truths = smooth.in_one_step(smooth.predator_and_prey(step))
    # In one step: h^4 of the method of order 3, h^5 of order 4.
    assert np.log2(estimates[:-1] / estimates[1:])[-2:] == pytest.approx(4.0, abs=0.1)
    assert np.log2(truths[:-1] / truths[1:])[-2:] == pytest.approx(5.0, abs=0.4)
    assert np.all(truths < estimates)


@pytest.mark.parametrize("rate", [1.0, 1e3, 1e8])
def test_what_is_linear_decays_whatever_its_rate(rate):
    graph = Graph()
    x, size = graph.input("x", CHANGING), graph.input("size", CHANGING)
    made = step([State("x", x, -rate * x, 1.0)], size, {}, {})
    (after,) = evaluate(made.states, {"x": 1.0, "size": 0.1})
    assert float(after) == pytest.approx(growth(VELDHUIZEN, -0.1 * rate).real, abs=1e-10)
    assert abs(float(after)) <= 1.0
