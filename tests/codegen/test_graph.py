"""The graph: equal arithmetic once, simplifications that keep bits, levels, and its errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.graph import CHANGING, FIXED, Graph
from pma_gym.codegen.text import evaluate
from pma_gym.codegen.trace import operation_counts, trace
from pma_gym.effects.arithmetic import clip, where


@pytest.fixture
def graph():
    return Graph()


@pytest.fixture
def x(graph):
    return graph.input("x", CHANGING)


@pytest.fixture
def y(graph):
    return graph.input("y", CHANGING)


@pytest.fixture
def p(graph):
    return graph.input("p", FIXED)


def test_equal_arithmetic_is_one_value(graph, x, y):
    assert x + y is y + x
    assert x * y is y * x
    assert x - y is not y - x
    assert 2.0 * x is x * 2
    assert graph.input("x", CHANGING) is x
    assert trace(clip, x, 0.0, 1.0) is trace(clip, x, 0.0, 1.0)
    assert (x < y) is (y > x)
    assert (x <= 1) is (1.0 >= x)


def test_constants_are_computed(graph):
    two = graph.constant(2)
    assert (two * 3.0 + 1.0).data == 7.0
    assert (two**0.5).data == 2.0**0.5
    assert (two / 0.0).data == float("inf")
    assert np.isnan(((-two) ** 0.5).data)
    assert (two < 3.0).data is True
    assert graph.constant(-1, "integer").data == 2**64 - 1
    assert graph.constant(0.0) is not graph.constant(-0.0)


OPERATIONS = ("add", "subtract", "multiply", "divide", "negative", "absolute", "root", "choose")
PROGRAM = st.lists(
    st.tuples(st.sampled_from(OPERATIONS), *[st.integers(0, 30)] * 3), min_size=1, max_size=14
)


def perform(step, numbers, select):
    """One step of a random program, on floats, arrays or values."""
    name, *at = step
    a, b, c = (numbers[i % len(numbers)] for i in at)
    small = numbers[at[1] % 4]
    return {
        "add": lambda: a + b,
        "subtract": lambda: a - b,
        "multiply": lambda: a * small,
        "divide": lambda: a / (1.0 + b * b),
        "negative": lambda: -a,
        "absolute": lambda: abs(a),
        "root": lambda: (abs(a) + 0.25) ** 0.5,
        "choose": lambda: select(a < b, c, a),
    }[name]()


@settings(max_examples=150, deadline=None)
@given(PROGRAM, st.lists(st.floats(-2.0, 2.0, width=16), min_size=2, max_size=2))
def test_simplified_arithmetic_keeps_every_bit(program, inputs):
    graph = Graph()
    arrays = [np.array(inputs[:1]), np.array(inputs[1:])]
    values = [graph.input("x", CHANGING), graph.input("y", CHANGING)]
    for numbers in (arrays, values):
        numbers += [numbers[0] * 0.5, numbers[1] - numbers[0]]
    for step in program:
        arrays.append(perform(step, arrays, np.where))
        values.append(perform(step, values, graph.select))
    computed = evaluate(values[2:], {"x": arrays[0], "y": arrays[1]})
    np.testing.assert_array_equal(np.ravel(computed), np.ravel(arrays[2:]))


def test_truths_combine(graph, x, y):
    low, high = x < 0.0, y > 1.0
    outputs = [low & high, low | high, ~low, low ^ high, low & True, graph.select(~low, x, y)]
    assert outputs[4] is low
    assert outputs[5] is graph.select(low, y, x)
    columns = {"x": np.array([-1.0, -1.0, 1.0, 1.0]), "y": np.array([0.0, 2.0, 0.0, 2.0])}
    computed = evaluate(outputs[:4], columns)
    assert [column.tolist() for column in computed] == [
        [False, True, False, False],
        [True, True, False, True],
        [False, False, True, True],
        [True, False, False, True],
    ]


def test_mistakes_are_named(graph, x):
    for error, message, act in (
        (TypeError, "use where", lambda: bool(x > 0.0)),
        (ValueError, "two graphs", lambda: x + Graph().input("x", CHANGING)),
        (ValueError, "input x is real of level 2 already", lambda: graph.input("x", FIXED)),
        (
            TypeError,
            "no add of real and integer",
            lambda: x + graph.input("i", CHANGING, "integer"),
        ),
        (TypeError, "not made of 1.5", lambda: graph.input("i", CHANGING, "integer") + 1.5),
        (
            TypeError,
            "plain number of 0 to 63 bits",
            lambda: graph.input("i", CHANGING, "integer") << 64,
        ),
        (TypeError, "NotImplemented", lambda: x + np.zeros(2)),
        (TypeError, "unsupported operand", lambda: x + "1"),
    ):
        with pytest.raises(error, match=message):
            act()
    assert (np.float64(2.0) * x) is x * 2.0


def test_a_law_of_numbers_stays_a_law_of_numbers():
    assert trace(where, True, 1.0, 2.0) == 1.0
    assert trace(clip, 5.0, 0.0, 1.0) == 1.0


def test_derivatives_share_what_they_have_in_common(graph, x, y):
    quotients = [x / (x * y + 2.0), y / (x * y + 2.0)]
    slopes = [s for row in derivatives(quotients, [x, y]) for s in row if s is not None]
    assert operation_counts(slopes)["divide"] == 3
