"""NumPy's functions in laws: NumPy's values, exact slopes, and the same bits everywhere.

Derivatives that a law says itself.
"""

import ctypes
import math
import shutil

import numpy as np
import pytest
import sympy

from pma_gym.codegen.derivative import derivative
from pma_gym.codegen.elementary import NUMPY
from pma_gym.codegen.graph import CHANGING, FIXED, Graph
from pma_gym.codegen.text import C_PREAMBLE, c_text, evaluate, python_text
from pma_gym.codegen.trace import operation_counts, trace
from pma_gym.effects.arithmetic import exponential, interp2d, sloping
from pma_gym.export.fmu import shared_library
from pma_gym.plant.forms.symbolic import _Expressions

LAWS = {
    "exp": lambda x: np.exp(x),
    "log": lambda x: np.log(x),
    "tanh": lambda x: np.tanh(x),
    "sin": lambda x: np.sin(x),
    "cos": lambda x: np.cos(x),
    "sqrt": lambda x: np.sqrt(x),
    "sign": lambda x: np.sign(x),
    "absolute": lambda x: np.abs(x),
    "minimum": lambda x: np.minimum(x, 0.5),
    "maximum": lambda x: np.maximum(np.float64(0.5), x),
    "square": lambda x: np.square(x),
    "clip": lambda x: np.clip(x, -1.0, 1.0),
    "where": lambda x: np.where(x > 0.3, x * x, np.negative(x)),
    "interp": lambda x: np.interp(x, (0.0, 1.0, 3.0), (0.0, 2.0, -1.0)),
    "cube": lambda x: x**3,
    "inverse square": lambda x: x**-2,
    "share": lambda x: x ** (2 / 3),
    "decay": lambda x: x**-0.7,
    "power": lambda x: np.power(np.abs(x), 1.5),
    "of two": lambda x: 2.0**x,
}
ENDS = (0.0, -0.0, math.inf, -math.inf, 1e-310, 1e300, -1e300)
ORDINARY = np.concatenate([np.linspace(-30.0, 30.0, 4096 + 1)[:-1], np.geomspace(1e-9, 1e6, 2048)])
"""Of a length that eight lanes divide."""


@pytest.fixture(params=LAWS)
def law(request):
    return LAWS[request.param]


def traced(law):
    x = Graph().input("x", CHANGING)
    return trace(law, x), x


def test_values_are_numpys(law):
    value, _ = traced(law)
    x = np.concatenate([ORDINARY, [0.0, -0.0, 1e-310, -700.0, 700.0]])
    with np.errstate(all="ignore"):
        expected = law(x)
    # A rounding of exponent * log(x) is that many of the power: 477 of 2^700.
    rtol = 1.1e-13 if law is LAWS["of two"] else 4e-15
    np.testing.assert_allclose(evaluate([value], {"x": x})[0], expected, rtol=rtol, atol=2e-15)


def test_a_sine_of_an_angle_without_digits_left_is_nan():
    for name in ("sin", "cos"):
        value, _ = traced(LAWS[name])
        x = np.array([1.1e6, -1e300, math.inf, math.nan])
        assert np.isnan(evaluate([value], {"x": x})[0]).all()


@pytest.mark.parametrize("name", ["exp", "log", "tanh", "sqrt", "sign"])
def test_infinities_and_nan_are_numpys(name):
    value, _ = traced(LAWS[name])
    x = np.array([*ENDS, math.nan, 800.0, -800.0])
    with np.errstate(all="ignore"):
        expected = getattr(np, name)(x)
    np.testing.assert_allclose(evaluate([value], {"x": x})[0], expected, rtol=4e-15)


def test_bits_are_the_same_in_text_arrays_and_lanes(law, run_columns):
    value, x = traced(law)
    (expected,) = evaluate([value], {"x": ORDINARY})
    text = {}
    exec(python_text([value], [x], "law"), text)
    some = np.flatnonzero(ORDINARY)[::7]
    plain = [text["law"](float(one))[0] for one in ORDINARY[some]]
    np.testing.assert_array_equal(plain, expected[some])
    for width in (1, 8):
        np.testing.assert_array_equal(
            run_columns([value], {"x": ORDINARY}, width), expected[None], err_msg=f"{width}"
        )


def test_slopes_are_central_differences(law):
    value, x = traced(law)
    (slope,) = derivative(value, [x])
    at, step = np.array([0.11, 0.41, 1.7, 2.9]), 1e-5
    (known,) = evaluate([slope], {"x": at}) if slope is not None else (0.0 * at,)
    with np.errstate(all="ignore"):
        expected = (law(at + step) - law(at - step)) / (2.0 * step)
    np.testing.assert_allclose(known, expected, rtol=1e-7, atol=1e-9)


def test_slopes_are_finite_at_zero_and_below():
    for name in ("share", "log", "power", "tanh", "sqrt"):
        value, x = traced(LAWS[name])
        (slope,) = derivative(value, [x])
        assert np.isfinite(evaluate([slope], {"x": np.array([0.0, -1.0])})[0]).all()


def test_sympy_has_them_too(law):
    x = sympy.Symbol("x", real=True)
    expression = _Expressions.__new__(_Expressions).apply(law, x)
    for at in (0.2, 1.3):
        assert float(expression.subs(x, at)) == pytest.approx(float(law(np.float64(at))), rel=1e-12)


def test_a_power_of_a_parameter_has_the_slopes_of_both():
    graph = Graph()
    x, n = graph.input("x", CHANGING), graph.input("n", FIXED)
    value = trace(lambda x, n: x**n, x, n)
    computed = evaluate([value, *derivative(value, [x, n])], {"x": 3.0, "n": 1.7})
    expected = [3.0**1.7, 1.7 * 3.0**0.7, 3.0**1.7 * math.log(3.0)]
    np.testing.assert_allclose(computed, expected, rtol=1e-14)


def test_a_table_of_two_inputs_is_linear_in_each_and_constant_outside():
    graph = Graph()
    x, y = graph.input("x", CHANGING), graph.input("y", CHANGING)
    table = (0.0, 1.0, 3.0), (0.0, 2.0), ((0.0, 1.0, 5.0), (2.0, 7.0, 3.0))
    value = trace(lambda x, y: interp2d(x, y, *table), x, y)
    at = {"x": np.array([0.5, 3.0, -1.0, 9.0, 2.0]), "y": np.array([1.0, 2.0, 1.0, 9.0, 0.0])}
    np.testing.assert_array_equal(evaluate([value], at)[0], [2.5, 3.0, 1.0, 3.0, 3.0])
    slopes = evaluate(derivative(value, [x, y]), {"x": 0.5, "y": 1.0})
    np.testing.assert_allclose(slopes, [3.0, 2.0])


def test_what_laws_cannot_have_is_said():
    x = Graph().input("x", CHANGING)
    for message, act in (
        (r"laws have no np.arctan like this; of np they have .*tanh", lambda: np.arctan(x)),
        (r"use NumPy's functions, such as np.tanh\(x\), not math's", lambda: math.tanh(x)),
        ("NotImplemented", lambda: np.exp(x) + np.zeros(2)),
    ):
        with pytest.raises(TypeError, match=message):
            act()
    assert set(NUMPY) >= {"exp", "log", "tanh", "sqrt", "minimum", "maximum", "sin", "cos"}


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


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler cc")
def test_c_has_the_bits_of_all_laws(tmp_path):
    graph = Graph()
    x = graph.input("x", CHANGING)
    values = [trace(law, x) for law in LAWS.values()]
    text = c_text({f"out[{i}]": value for i, value in enumerate(values)}, {x.id: "x"})
    head = "#include <math.h>\n#include <stdint.h>\n#include <string.h>\n" + C_PREAMBLE
    source = f"{head}void laws(double x, double *out) {{\n{text}\n}}\n"
    (tmp_path / "laws.so").write_bytes(shared_library({"laws.c": source}, ["laws.c"]))
    function = ctypes.CDLL(str(tmp_path / "laws.so")).laws
    function.argtypes = [ctypes.c_double, ctypes.c_void_p]
    arguments = np.array([*ENDS, *ORDINARY[::16], math.nan])
    got = np.empty((len(arguments), len(values)))
    for argument, row in zip(arguments, got, strict=True):
        function(argument, row.ctypes.data)
    expected = np.stack(evaluate(values, {"x": arguments}), axis=1)
    assert np.array_equal(got, expected, equal_nan=True)
