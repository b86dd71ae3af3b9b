"""Calls a law on traced values, asks a graph what it consists of, and puts values in its place."""

import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np

from pma_gym.codegen.generic import sloping, where
from pma_gym.codegen.graph import Value


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


def trace(law: Callable, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401
    """Trace a law: return its result for symbolic values, as values of their graph.

    Args:
        law: a function written in the arithmetic of `pma_gym.effects.arithmetic`.
        arguments: its arguments: values, numbers, named tuples of both.
        named: more of them, by name.
    Returns:
        What the law returns: a value, a tuple of values, or numbers that depend on no value.
    """
    return _traceable(law)(*arguments, **named)


@cache
def _traceable(law: Callable) -> Callable:
    return rebind(law, {"where": where, "sloping": sloping})


def order(
    outputs: Iterable[Value], parts: Callable[[Value], Iterable[Value]] = attrgetter("operands")
) -> list[Value]:
    """All that the outputs are made of, and themselves, parts before what is made of them."""
    seen: dict[int, Value] = {}
    waiting = list(outputs)
    while waiting:
        value = waiting.pop()
        if value.id not in seen:
            seen[value.id] = value
            waiting.extend(parts(value))
    # Values are numbered in order of making, operands first.
    return [seen[i] for i in sorted(seen)]


def live_inputs(outputs: Iterable[Value]) -> list[Value]:
    """The inputs that the outputs depend on."""
    return [value for value in order(outputs) if value.operation == "input"]


def split(outputs: Sequence[Value], level: int) -> list[Value]:
    """What changes no more often than a level and is used by what does, or is an output.

    These are to be computed beforehand and kept. What the kept ones of a higher level need in turn
    is kept too where it is of a lower level, so that `split(outputs, 0)` is the whole table of a
    model's life and those of level 1 in `split(outputs, 1)` all that is to be kept beside it.

    Args:
        outputs: results of the calculation.
        level: FIXED or HELD.
    Returns:
        Values of the level or below, no constants, in order; inputs only where used directly.
    """
    values = list(outputs)
    kept = {value.id: value for value in values if value.level <= level}
    for value in order(values):
        if value.level > level:
            kept.update({part.id: part for part in value.operands if part.level <= level})
    return [kept[i] for i in sorted(kept) if not kept[i].is_constant]


_SORTS: tuple[str, ...] = ("add", "multiply", "divide", "square_root", "choose", "integer")
_COUNTED = {
    "add": "add",
    "subtract": "add",
    "multiply": "multiply",
    "divide": "divide",
    "square_root": "square_root",
}


def operation_counts(outputs: Iterable[Value], level: int | None = None) -> dict[str, int]:
    """How many operations of each sort the outputs take, each value counted once.

    Args:
        outputs: results of the calculation.
        level: count operations of this level only; all if None.
    Returns:
        add (with subtractions), multiply, divide, square_root, choose (signs, comparisons,
        choices, rounding) and integer (with conversions).
    """
    counts = dict.fromkeys(_SORTS, 0)
    for value in order(outputs):
        if value.operands and level in (None, value.level):
            counts[_sort(value)] += 1
    return counts


def _sort(value: Value) -> str:
    if value.kind == "integer" or any(operand.kind == "integer" for operand in value.operands):
        return "integer"
    return _COUNTED.get(value.operation, "choose")


def substitute(outputs: Sequence[Value], replacements: Mapping[int, Value]) -> list[Value]:
    """Return the outputs with some values replaced by others.

    Args:
        outputs: traced values.
        replacements: new values by the `Value.id` of those that they replace.
    Returns:
        The outputs, made of the new values; what depends on none of them stays the same value.
    """
    replaced = dict(replacements)
    for value in order(outputs):
        if value.id in replaced:
            continue
        parts = [replaced[part.id] for part in value.operands]
        same = all(a is b for a, b in zip(parts, value.operands, strict=True))
        replaced[value.id] = value if same else value.graph.apply(value.operation, *parts)
    return [replaced[value.id] for value in outputs]
