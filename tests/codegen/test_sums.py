"""Sums of many terms, in the order in which these are there."""

from fractions import Fraction

import numpy as np
import pytest

from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.machine.simd import Sums
from pma_gym.codegen.trace import order


@pytest.fixture
def graph():
    return Graph()


def terms_of(total, *others):
    """Terms of a sum as (sign, names or operations of its factors)."""
    terms = Sums(order([total, *others]), [total, *others]).terms[total.id]
    return [
        ("-" if term.is_negative else "+", *[f.data or f.operation for f in term.factors])
        for term in terms
    ]


def named(graph, names):
    return [graph.input(name, CHANGING) for name in names]


def test_what_is_late_is_added_last(graph):
    a, b, c = named(graph, "abc")
    assert terms_of(a**0.5 + b - c) == [("+", "b"), ("-", "c"), ("+", "square_root")]
    # A root waits for longer than two sums, and a quotient for longer than three.
    assert terms_of(a**0.5 - b * (a + b)) == [("+", "square_root"), ("-", "b", "add")]
    assert terms_of(a / b - b * (a + b * c) + c) == [
        ("+", "c"),
        ("-", "b", "add"),
        ("+", "divide"),
    ]


def test_what_is_asked_for_or_used_elsewhere_stays_a_term(graph):
    a, b, c = named(graph, "abc")
    inner, product = a + b, a * b
    assert terms_of(inner + c, inner) == [("+", "c"), ("+", "add")]
    assert terms_of(inner + c, inner * 2.0) == [("+", "c"), ("+", "add")]
    assert terms_of(product + c, product) == [("+", "c"), ("+", "multiply")]
    assert terms_of(product + c, product**0.5) == [("+", "c"), ("+", "multiply")]
    # A product in several sums costs none of them anything.
    assert terms_of(product + c, product - c) == [("+", "c"), ("+", "a", "b")]


@pytest.mark.parametrize("width", [1, 4])
def test_every_sign_at_every_place_gives_the_sum(graph, run_columns, width):
    a, b, c, d = named(graph, "abcd")
    draw = np.random.default_rng(5)
    given = {name: draw.normal(size=16) for name in "abcd"}
    totals = [
        *(a - b - c - d, (-a - b) - (c + d), (-a - b) - (c - d)),
        *(-(a * b) - c * d, c - a * b - c * d, -c - a * b - c * d - d, d - c - (a * b - c)),
        *((a * c - (a * b - c)) - d * (a - b), (a + b) * (c - d) - (a - d)),
    ]
    for total, column in zip(totals, run_columns(totals, given, width, fused=True), strict=True):
        numbers = zip(*given.values(), strict=True)
        exact = [
            _value(total, dict(zip("abcd", map(Fraction, row), strict=True))) for row in numbers
        ]
        np.testing.assert_allclose(column, np.array(exact, float), rtol=0.0, atol=4e-15)


def _value(value, given):
    """A sum of sums and products in rationals."""
    if value.operation == "input":
        return given[value.data]
    parts = [_value(part, given) for part in value.operands]
    how = {"add": sum, "subtract": lambda p: p[0] - p[1], "multiply": lambda p: p[0] * p[1]}
    return -parts[0] if value.operation == "negative" else how[value.operation](parts)
