"""Functions beyond the operators, for traced values, plain numbers and NumPy arrays alike.

What is written in the operators and in these runs on all three: the laws themselves need no more
than `where`, random numbers need the others.
"""

from typing import Any

import numpy as np

from pma_gym.codegen.folding import Value, compute


def where(condition: Any, yes: Any, no: Any) -> Any:  # noqa: ANN401
    """`yes` where the condition holds, else `no`.

    >>> where(True, 1.0, 2.0), where(np.array([True, False]), 1.0, 2.0).tolist()
    (1.0, [1.0, 2.0])
    """
    if isinstance(condition, Value):
        return condition.graph.select(condition, yes, no)
    if isinstance(condition, np.ndarray):
        return np.where(condition, yes, no)
    return yes if condition else no


def sloping(value: Any, argument: Any, slope: Any) -> Any:  # noqa: ANN401
    """Return the value unchanged; for a traced value, store its derivative by the argument."""
    if isinstance(value, Value) and isinstance(argument, Value):
        value.graph.slopes[value.id] = argument, value.graph.value(slope)
    return value


def to_real(integer: Any) -> Any:  # noqa: ANN401
    """The real number nearest to an unsigned 64-bit integer.

    >>> to_real(3), to_real(np.array([3], np.uint64)).tolist()
    (3.0, [3.0])
    """
    if isinstance(integer, Value):
        return integer.graph.apply("to_real", integer)
    if isinstance(integer, np.ndarray | np.generic):
        return integer.astype(np.float64)
    return float(integer)


def to_bits(real: Any) -> Any:  # noqa: ANN401
    """The 64 bits of a real number, as an unsigned integer.

    >>> hex(to_bits(1.0)), hex(to_bits(np.array([1.0]))[0])
    ('0x3ff0000000000000', '0x3ff0000000000000')
    """
    if isinstance(real, Value):
        return real.graph.apply("bits", real)
    if isinstance(real, np.ndarray | np.generic):
        return real.view(np.uint64)
    return compute("bits", "real", [real])


def from_bits(bits: Any) -> Any:  # noqa: ANN401
    """The real number of these 64 bits: the inverse of `to_bits`.

    >>> from_bits(to_bits(-0.1)), from_bits(to_bits(np.array([-0.1]))).tolist()
    (-0.1, [-0.1])
    """
    if isinstance(bits, Value):
        return bits.graph.apply("from_bits", bits)
    if isinstance(bits, np.ndarray | np.generic):
        return bits.view(np.float64)
    return compute("from_bits", "integer", [bits])


def floor(real: Any) -> Any:  # noqa: ANN401
    """The greatest whole number that is not above, as a real; what is not finite stays.

    >>> floor(-1.5), floor(np.array([-1.5])).tolist()
    (-2.0, [-2.0])
    """
    if isinstance(real, Value):
        return real.graph.apply("floor", real)
    if isinstance(real, np.ndarray | np.generic):
        return np.floor(real)
    return compute("floor", "real", [real])


def square_root(real: Any) -> Any:  # noqa: ANN401
    """The square root, correctly rounded, which a library's x ** 0.5 need not be; NaN below 0.

    >>> square_root(4.0), square_root(np.array([4.0])).tolist()
    (2.0, [2.0])
    """
    if isinstance(real, Value):
        return real.graph.apply("square_root", real)
    if isinstance(real, np.ndarray | np.generic):
        return np.sqrt(real)
    return compute("square_root", "real", [real])
