"""Substitution of values in traced arithmetic."""

from collections.abc import Mapping, Sequence

from pma_gym.codegen.graph import Value
from pma_gym.codegen.trace import order


def substitute(outputs: Sequence[Value], given: Mapping[int, Value]) -> list[Value]:
    """Return the outputs with some values replaced by others.

    Args:
        outputs: traced values.
        given: new values by the `Value.id` of those that they replace.
    Returns:
        The outputs, made of the new values; what depends on none of them stays the same value.
    """
    replaced = dict(given)
    for value in order(outputs):
        if value.id in replaced:
            continue
        parts = [replaced[part.id] for part in value.operands]
        same = all(a is b for a, b in zip(parts, value.operands, strict=True))
        replaced[value.id] = value if same else value.graph.apply(value.operation, *parts)
    return [replaced[value.id] for value in outputs]
