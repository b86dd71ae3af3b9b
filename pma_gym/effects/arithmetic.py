"""Arithmetic functions for the laws of effects.

Every law uses + - * / ** `abs`, comparisons, the functions of `pma_gym.codegen.elementary` by these
names or as NumPy's (`np.exp`), and the functions below, nothing else. Each is one scalar expression
without side effects, so that the same text runs as plain Python, compiled for one trial and in SIMD
lanes with the same bits. `as_numpy` rebinds `where` for NumPy arrays.
"""

from pma_gym.codegen.elementary import (
    clip,
    cos,
    exp,
    interp,
    interp2d,
    log,
    maximum,
    minimum,
    power,
    sign,
    sin,
    sqrt,
    tanh,
)
from pma_gym.codegen.generic import floor

__all__ = [
    "clip",
    "cos",
    "cosine",
    "exp",
    "exponential",
    "interp",
    "interp2d",
    "log",
    "maximum",
    "minimum",
    "positive",
    "power",
    "sign",
    "sin",
    "sloping",
    "smoothstep",
    "sqrt",
    "tanh",
    "where",
]

_TURNS = 95.0 * 2.0 * 3.141592653589793


def where(condition, yes, no):
    """Return `yes` where the condition holds, else `no`; both sides are evaluated."""
    return yes if condition else no


def positive(value):
    """Return the positive part, max(0, value); exact.

    >>> positive(3.5), positive(-3.5)
    (3.5, 0.0)
    """
    return 0.5 * (value + abs(value))


def smoothstep(value):
    """Blend from 0 to 1 as the value goes from 0 to 1, with zero slope at both ends.

    >>> smoothstep(-1.0), smoothstep(0.5), smoothstep(2.0)
    (0.0, 0.5, 1.0)
    """
    share = clip(value, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def sloping(value, argument, slope):
    """Return the value unchanged and give its derivative with respect to the argument.

    Symbolic differentiation then uses `slope` instead of differentiating the value's expression.

    >>> sloping(9.0, 3.0, 6.0)
    9.0
    """
    return value


def exponential(value):
    """Compute exp(value) by Taylor's series at value/128, squared seven times.

    Relative error below 1e-12 for |value| <= 12, the range of the catalogue's laws, in half of the
    arithmetic of `exp`. A Pade quotient needs a division, which takes as long as eight products.

    >>> import math
    >>> abs(exponential(-8.0) / math.exp(-8.0) - 1.0) < 1e-12
    True
    """
    # By halves (Estrin 1960): products that wait for each other cost more than they are many.
    c = 1.0 / 128.0
    square = value * value
    fourth = square * square
    low = (1.0 + value * c) + square * (c**2 / 2.0 + value * (c**3 / 6.0))
    middle = c**4 / 24.0 + value * (c**5 / 120.0)
    high = middle + square * (c**6 / 720.0 + value * (c**7 / 5040.0))
    root = low + fourth * (high + fourth * (c**8 / 40320.0))
    for _ in range(7):
        root = root * root
    return sloping(root, value, root)


def cosine(value):
    """Compute cos(value) by Taylor's series of 1 - cos at value/256 and eight angle doublings.

    Absolute error below 1e-11 for |value| <= 1e4, in half of the arithmetic of `cos`. Working with
    u = 1 - cos keeps the digits where u is small: doubling the angle turns u into 2 u (2 - u).
    The series ends at 300 rad: 95 turns are taken off first, as often as they fit.

    >>> import math
    >>> max(abs(cosine(0.5 * i) - math.cos(0.5 * i)) for i in range(-20000, 20001)) < 1e-11
    True
    """
    z = (value - _TURNS * floor(value * (1.0 / _TURNS) + 0.5)) * (1.0 / 256.0)
    square = z * z
    rest = 1.0 - square * (1.0 / 182.0) * (1.0 - square * (1.0 / 240.0))
    rest = 1.0 - square * (1.0 / 90.0) * (1.0 - square * (1.0 / 132.0) * rest)
    rest = 1.0 - square * (1.0 / 30.0) * (1.0 - square * (1.0 / 56.0) * rest)
    below = 0.5 * square * (1.0 - square * (1.0 / 12.0) * rest)
    for _ in range(8):
        below = 2.0 * below * (2.0 - below)
    return 1.0 - below
