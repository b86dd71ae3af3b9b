"""Evaluation of a law with other kinds of number: NumPy arrays, SymPy expressions.

A law calls nothing but the functions of `pma_gym.effects.arithmetic` and NumPy's; binding those
anew gives the same law for another kind of number, without a second copy of it.
"""

import types
from collections.abc import Callable, Mapping

import numpy as np


def rebind(function: Callable, names: Mapping[str, Callable]) -> Callable:
    """Return a copy of a function in which the calls of given names are replaced.

    Args:
        function: a law, or a generated function that calls laws.
        names: replacements by name, such as {"where": numpy.where}.
    Returns:
        A new function of the same text.
    """
    return _rebind(function, names, {})


def _rebind(
    function: Callable, names: Mapping[str, Callable], done: dict[int, Callable]
) -> Callable:
    if id(function) in done:
        return done[id(function)]
    assert isinstance(function, types.FunctionType)
    own = dict(function.__globals__)
    fresh = types.FunctionType(
        function.__code__, own, function.__name__, function.__defaults__, function.__closure__
    )
    done[id(function)] = fresh
    for name in function.__code__.co_names:
        value = own.get(name)
        if name in names:
            own[name] = names[name]
        elif value is np:
            own[name] = types.SimpleNamespace(**{**vars(np), **names})
        elif isinstance(value, types.FunctionType):
            own[name] = _rebind(value, names, done)
    return fresh


def as_numpy(function: Callable) -> Callable:
    """Return a law for NumPy arrays.

    >>> from pma_gym.effects.arithmetic import clip
    >>> as_numpy(clip)(np.array([-1.0, 0.5, 2.0]), 0.0, 1.0).tolist()
    [0.0, 0.5, 1.0]
    """
    return rebind(function, {"where": np.where, "exponential": np.exp})
