"""Random numbers that depend on nothing but a counter and a key.

The same numbers come out of Python and of every width of compiled code, in whatever order lanes
are computed. Written in operators and `generic`, so they take traced integers, plain ones and
arrays of unsigned 64-bit integers; words have 32 bits and stand in 64.
"""

import math
from typing import Any

from pma_gym.codegen.generic import floor, from_bits, square_root, to_bits, to_real, where

Words = tuple[Any, Any, Any, Any]
"""Four words of 32 bits."""

_WORD = 0xFFFFFFFF
_MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
_KEY_STEPS = (0x9E3779B9, 0xBB67AE85)
_ROUNDS = 10

_MANTISSA = (1 << 52) - 1
_ONE = 1023 << 52
_ATANH = tuple(2.0 / (2 * k + 1) for k in range(11))
_SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(8))
_COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(9))


def philox(counter: Words, key: tuple[Any, Any]) -> Words:
    """Philox4x32-10: four random words for a counter and a key.

    >>> [hex(word) for word in philox((0, 0, 0, 0), (0, 0))]
    ['0x6627e8d5', '0xe169c58d', '0xbc57ac4c', '0x9b00dbd8']

    Source:
        J. K. Salmon and others 2011, "Parallel random numbers: as easy as 1, 2, 3".
    """
    a, b, c, d = counter
    first, second = key
    for _ in range(_ROUNDS):
        left, right = _MULTIPLIERS[0] * a, _MULTIPLIERS[1] * c
        a, b, c, d = (
            (right >> 32) ^ b ^ first,
            right & _WORD,
            (left >> 32) ^ d ^ second,
            left & _WORD,
        )
        first, second = (first + _KEY_STEPS[0]) & _WORD, (second + _KEY_STEPS[1]) & _WORD
    return a, b, c, d


def uniform(word: Any) -> Any:  # noqa: ANN401
    """A number between 0 and 1, neither of them, from a word: (word + 1/2) / 2^32."""
    return (to_real(word) + 0.5) * 2.0**-32


def uniforms(words: Words) -> Words:
    """Four numbers between 0 and 1, neither of them."""
    a, b, c, d = words
    return uniform(a), uniform(b), uniform(c), uniform(d)


def normals(words: Words) -> Words:
    """Four standard normal numbers, none beyond 6.77, by Box and Muller's transform."""
    a, b, c, d = uniforms(words)
    return *_pair(a, b), *_pair(c, d)


def _pair(a: Any, b: Any) -> tuple[Any, Any]:  # noqa: ANN401
    radius = square_root(-2.0 * logarithm(a))
    sine, cosine = sine_cosine(b)
    return radius * cosine, radius * sine


def logarithm(value: Any) -> Any:  # noqa: ANN401
    """Natural logarithm of a positive, normal number; relative error below 1e-14.

    value = 2^e m with m within a factor sqrt(2) of 1, and log m = 2 artanh((m - 1) / (m + 1)).
    """
    bits = to_bits(value)
    exponent = to_real(bits >> 52) - 1023.0
    mantissa = from_bits((bits & _MANTISSA) | _ONE)
    above = mantissa > math.sqrt(2.0)
    exponent = where(above, exponent + 1.0, exponent)
    mantissa = where(above, 0.5 * mantissa, mantissa)
    ratio = (mantissa - 1.0) / (mantissa + 1.0)
    return exponent * math.log(2.0) + ratio * _polynomial(ratio * ratio, _ATANH)


def sine_cosine(turns: Any) -> tuple[Any, Any]:  # noqa: ANN401
    """Sine and cosine of 2 pi times a number from 0 to 1; relative error below 1e-14.

    The number is a quarter of a turn, 0 to 4, and a rest within an eighth of one.
    """
    quarter = floor(4.0 * turns + 0.5)
    angle = 0.5 * math.pi * (4.0 * turns - quarter)
    square = angle * angle
    sine, cosine = angle * _polynomial(square, _SINE), _polynomial(square, _COSINE)
    odd = (quarter == 1.0) | (quarter == 3.0)
    sine, cosine = where(odd, cosine, sine), where(odd, sine, cosine)
    return (
        where((quarter > 1.5) & (quarter < 3.5), -sine, sine),
        where((quarter > 0.5) & (quarter < 2.5), -cosine, cosine),
    )


def _polynomial(value: Any, coefficients: tuple[float, ...]) -> Any:  # noqa: ANN401
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * value + coefficient
    return total
