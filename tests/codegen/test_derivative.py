"""Derivatives that a law says itself."""

import math

import pytest

from pma_gym.codegen.derivative import derivative
from pma_gym.codegen.graph import CHANGING, FIXED, Graph
from pma_gym.codegen.text import evaluate
from pma_gym.codegen.trace import operation_counts, trace
from pma_gym.effects.arithmetic import exponential, sloping


@pytest.mark.parametrize("factor", [-1.0, -2.5, 1.0, 0.75])
def test_it_follows_the_chain_rule_whatever_becomes_of_its_argument(factor):
    # A factor of -1 is simplified out of what the exponential is made of.
    graph = Graph()
    x, scale = graph.input("x", CHANGING), graph.input("scale", FIXED)
    value = scale * trace(exponential, factor * x)
    (slope,) = derivative(value, [x])
    (curvature,) = derivative(slope, [x])
    computed = evaluate([value, slope, curvature], {"x": 0.7, "scale": 3.0})
    truth = 3.0 * math.exp(0.7 * factor)
    expected = [truth, factor * truth, factor * factor * truth]
    assert [float(number) for number in computed] == pytest.approx(expected, rel=1e-12)


def test_a_derivative_costs_no_second_series():
    x = Graph().input("x", CHANGING)
    value = trace(exponential, -2.0 * x)
    (slope,) = derivative(value, [x])
    plain, both = (sum(operation_counts(v).values()) for v in ([value], [value, slope]))
    assert both <= plain + 2


def test_a_law_may_say_a_slope_of_its_own():
    x = Graph().input("x", CHANGING)
    value = trace(lambda x: sloping(x * x, x, 2.0 * x + 1.0), x)
    (slope,) = derivative(value, [x])
    assert float(evaluate([slope], {"x": 3.0})[0]) == 7.0


def test_what_a_law_says_of_another_value_stays_out_of_it():
    graph = Graph()
    x, y = graph.input("x", CHANGING), graph.input("y", CHANGING)
    value = trace(exponential, y) * x
    by_x, by_y = derivative(value, [x, y])
    computed = evaluate([by_x, by_y], {"x": 2.0, "y": 0.5})
    expected = [math.exp(0.5), 2.0 * math.exp(0.5)]
    assert [float(number) for number in computed] == pytest.approx(expected, rel=1e-12)
