"""Elementary functions by NumPy's names, for traced values, plain numbers and NumPy arrays alike.

A library's functions neither vectorise nor have the same bits on every machine. These are written
in the operators, so that all compiled code and Python text has their bits, and traced values know
their exact derivatives. Errors are a few units in the last place; where NumPy gives NaN or an
infinity, they do too. `np.exp(x)` of a traced value is `exp(x)` (`Value.__array_ufunc__`).
"""

import math
import operator
from typing import Any

from pma_gym.codegen.folding import MASK, NUMPY
from pma_gym.codegen.generic import floor, from_bits, sloping, square_root, to_bits, to_real, where

_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
"""The logarithm of 2 in two parts, of which a whole number times the first is exact."""

_HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
"""Half of pi in three parts, likewise."""

_SHIFT = 1.5 * 2.0**52
"""Added to a whole number, it leaves the number in the lowest bits."""


def minimum(a: Any, b: Any) -> Any:  # noqa: ANN401
    """The lesser of two numbers; the second if one is NaN.

    >>> minimum(1.0, -2.0)
    -2.0
    """
    return where(a < b, a, b)


def maximum(a: Any, b: Any) -> Any:  # noqa: ANN401
    """The greater of two numbers; the second if one is NaN.

    >>> maximum(1.0, -2.0)
    1.0
    """
    return where(a > b, a, b)


def sign(x: Any) -> Any:  # noqa: ANN401
    """1 above 0, -1 below, else 0.

    >>> sign(-0.1)
    -1.0
    """
    return where(x > 0.0, 1.0, where(x < 0.0, -1.0, 0.0 * x))


def exp(x: Any) -> Any:  # noqa: ANN401
    """The exponential function.

    >>> exp(1.0), exp(-800.0), exp(800.0)
    (2.718281828459045, 0.0, inf)
    """
    twos, rest = _exponential_parts(where(x > 710.0, 710.0, where(x < -746.0, -746.0, x)))
    half = floor(0.5 * twos)
    # In two factors: 2^n alone would leave the range before the result does.
    value = (1.0 + rest) * _power_of_two(half) * _power_of_two(twos - half)
    return sloping(value, x, value)


def log(x: Any) -> Any:  # noqa: ANN401
    """The natural logarithm; -inf of 0, NaN of a negative number.

    >>> log(10.0), log(0.0), log(-1.0)
    (2.302585092994046, -inf, nan)
    """
    # NaN goes the way of 1 and comes back at the end.
    known = where(x > 0.0, x, 1.0)
    small = known < 2.0**-1000
    bits = to_bits(where(small, known * 2.0**100, known))
    twos = to_real(bits >> 52) - where(small, 1123.0, 1023.0)
    part = from_bits((bits & ((1 << 52) - 1)) | (1023 << 52))
    above = part > math.sqrt(2.0)
    twos = where(above, twos + 1.0, twos)
    part = where(above, 0.5 * part, part) - 1.0
    share = part / (2.0 + part)
    square, series = share * share, 0.0
    for k in range(21, 1, -2):
        series = square * (1.0 / k + series)
    value = twos * _LN2_HIGH + (2.0 * (share + share * series) + twos * _LN2_LOW)
    value = where(x < math.inf, value, x)
    value = where(x > 0.0, value, where(x == 0.0, -math.inf, math.nan))
    return sloping(value, x, 1.0 / known)


def tanh(x: Any) -> Any:  # noqa: ANN401
    """The hyperbolic tangent.

    >>> tanh(-0.5), tanh(1e-9), tanh(1000.0)
    (-0.46211715726000973, 1e-09, 1.0)
    """
    size = abs(x)
    twos, rest = _exponential_parts(2.0 * where(size > 22.0, 22.0, size))
    scale = _power_of_two(twos)
    # exp(2 |x|) - 1, with all digits where it is small.
    more = scale * rest + (scale - 1.0)
    value = more / (more + 2.0)
    value = where(x < 0.0, -value, value)
    return sloping(value, x, 1.0 - value * value)


def sin(x: Any) -> Any:  # noqa: ANN401
    """The sine, to 1e-15 for |x| up to 1e6; NaN beyond.

    >>> sin(1.0)
    0.8414709848078965
    """
    return _sine_cosine(x)[0]


def cos(x: Any) -> Any:  # noqa: ANN401
    """The cosine, to 1e-15 for |x| up to 1e6; NaN beyond.

    >>> cos(1.0)
    0.5403023058681398
    """
    return _sine_cosine(x)[1]


def sqrt(x: Any) -> Any:  # noqa: ANN401
    """The square root, correctly rounded; NaN of a negative number. Its slope at 0 counts as 0.

    >>> sqrt(2.25)
    1.5
    """
    root = square_root(x)
    return sloping(root, x, where(root > 0.0, 0.5 / where(root > 0.0, root, 1.0), 0.0))


def power(x: Any, exponent: Any) -> Any:  # noqa: ANN401
    """A power, `x ** exponent`: a whole one by products, another one as exp(exponent log(x)).

    As in NumPy, a negative number has whole constant powers only; another one is NaN. Write
    `abs(x) ** (2 / 3)` where x changes its sign. The slope of a power at 0 counts as 0 where it is
    infinite, but that of `x ** 0.5`, which the catalogue's laws take; write `np.sqrt(x)`.

    >>> power(-2.0, 3), power(2.0, -2), power(8.0, 2 / 3), power(-8.0, 2 / 3), power(0.0, 2 / 3)
    (-8.0, 0.25, 4.0, nan, 0.0)
    """
    if not isinstance(exponent, int | float):
        return _real_power(x, exponent)
    if exponent == 0.5:
        return square_root(x)
    if exponent != math.floor(exponent) or abs(exponent) > 64:
        return _real_power(x, exponent)
    if exponent < 0:
        return 1.0 / power(x, -exponent)
    return _whole_power(x, int(exponent))


def _whole_power(x: Any, exponent: int) -> Any:  # noqa: ANN401
    if exponent < 2:
        return x if exponent else 1.0 + 0.0 * x
    half = _whole_power(x, exponent // 2)
    return half * half * x if exponent % 2 else half * half


def _real_power(x: Any, exponent: Any) -> Any:  # noqa: ANN401
    value = exp(exponent * log(where(x > 0.0, x, 1.0)))
    at_zero = where(exponent > 0.0, 0.0, where(exponent < 0.0, math.inf, 1.0))
    return where(x > 0.0, value, where(x == 0.0, at_zero, math.nan))


def _exponential_parts(x: Any) -> tuple[Any, Any]:  # noqa: ANN401
    """Whole n and exp(r) - 1 with x = n log(2) + r and |r| up to log(2) / 2."""
    twos = floor(x * (1.0 / math.log(2.0)) + 0.5)
    rest = (x - twos * _LN2_HIGH) - twos * _LN2_LOW
    series = 1.0 / math.factorial(13)
    for k in range(12, 0, -1):
        series = 1.0 / math.factorial(k) + rest * series
    return twos, rest * series


def _power_of_two(whole: Any) -> Any:  # noqa: ANN401
    """2^n of a whole real n from -1022 to 1023, by its bits."""
    exponent = ((to_bits(whole + _SHIFT) << 52) & MASK) + (1023 << 52)
    return from_bits(exponent & MASK)


def _sine_cosine(x: Any) -> tuple[Any, Any]:  # noqa: ANN401
    quarters = floor(x * (2.0 / math.pi) + 0.5)
    rest = where(abs(x) <= 1e6, x, math.nan)
    for part in _HALF_PI:
        rest = rest - quarters * part
    square = rest * rest
    sine, cosine = 0.0, 0.0
    for k in range(18, 0, -2):
        cosine = square * ((-1.0) ** (k // 2) / math.factorial(k) + cosine)
        sine = square * ((-1.0) ** (k // 2) / math.factorial(k + 1) + sine)
    sine, cosine = rest + rest * sine, 1.0 + cosine
    turn = to_bits(quarters + _SHIFT) & 3
    is_odd = (turn & 1) == 1
    first, second = where(is_odd, cosine, sine), where(is_odd, sine, cosine)
    value = where(turn < 2, first, -first)
    slope = where((turn == 1) | (turn == 2), -second, second)
    return sloping(value, x, slope), sloping(slope, x, -value)


def interp(x: Any, xp: Any, fp: Any) -> Any:  # noqa: ANN401
    """Interpolate linearly between knots; the result is constant outside them.

    Args:
        x: where to interpolate.
        xp: knots, a tuple of increasing numbers.
        fp: heights, a tuple of as many numbers.
    Returns:
        The height at `x`.

    >>> interp(1.5, (0.0, 1.0, 2.0), (0.0, 10.0, 30.0)), interp(9.0, (0.0, 1.0), (0.0, 10.0))
    (20.0, 10.0)
    """
    height = fp[0]
    for i in range(len(xp) - 1):
        share = clip((x - xp[i]) / (xp[i + 1] - xp[i]), 0.0, 1.0)
        height = height + share * (fp[i + 1] - fp[i])
    return height


def interp2d(x: Any, y: Any, xp: Any, yp: Any, fp: Any) -> Any:  # noqa: ANN401
    """Interpolate linearly in a table of two inputs; the result is constant outside it.

    Args:
        x: first input.
        y: second input.
        xp: knots of the first, a tuple of increasing numbers.
        yp: knots of the second, likewise.
        fp: heights, a row for every knot of the second input, with a height for every one of the
            first.
    Returns:
        The height at `x` and `y`.

    >>> interp2d(0.5, 0.5, (0.0, 1.0), (0.0, 1.0), ((0.0, 2.0), (4.0, 6.0)))
    3.0
    """
    return interp(y, yp, tuple(interp(x, xp, row) for row in fp))


def clip(value: Any, lower: Any, upper: Any) -> Any:  # noqa: ANN401
    """Limit the value to two bounds; exact.

    >>> clip(5.0, 0.0, 1.0), clip(0.25, 0.0, 1.0)
    (1.0, 0.25)
    """
    return where(value < lower, lower, where(value > upper, upper, value))


NUMPY.update(
    {
        function.__name__: function
        for function in (minimum, maximum, sign, exp, log, tanh, sin, cos, sqrt, power)
    }
    | {function.__name__: function for function in (floor, where, clip, interp)}
    | {
        "absolute": abs,
        "square": lambda x: x * x,
        "negative": operator.neg,
        "add": operator.add,
        "subtract": operator.sub,
        "multiply": operator.mul,
        "divide": operator.truediv,
        "less": operator.lt,
        "less_equal": operator.le,
        "greater": operator.gt,
        "greater_equal": operator.ge,
        "equal": operator.eq,
        "not_equal": operator.ne,
    }
)
