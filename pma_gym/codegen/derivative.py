"""Exact derivatives of traced values, as values of the same graph."""

from collections.abc import Callable, Sequence

from pma_gym.codegen.graph import Value
from pma_gym.codegen.trace import order

Slope = Value | None


def derivative(value: Value, wrt: Sequence[Value]) -> list[Slope]:
    """Partial derivatives of one value; see `derivatives`."""
    return derivatives([value], wrt)[0]


def derivatives(values: Sequence[Value], wrt: Sequence[Value]) -> list[list[Slope]]:
    """Partial derivatives of values, by forward accumulation.

    What several of them need is shared. A choice has the derivative of the side chosen; |x| at 0
    that of x; a value of `Graph.slopes` the one that is known.

    Args:
        values: real values.
        wrt: real values to differentiate with respect to, inputs or not; each is held independent
            of the others and of what it is made of.
    Returns:
        One row a value, with one derivative for each of `wrt`; None where it is zero whatever the
        numbers are.
    Raises:
        TypeError: a value that depends on one of `wrt` through its bits.
    """
    nodes = order(values, _depends_on)
    columns = [_along(nodes, seed, {other.id for other in wrt}) for seed in wrt]
    return [[column[value.id] for column in columns] for value in values]


def _depends_on(value: Value) -> Sequence[Value]:
    """What a value's derivative is made of: what it is known by, else what it is made of."""
    known = value.graph.slopes.get(value.id)
    return known[:1] if known else value.operands


def _along(nodes: list[Value], seed: Value, constants: set[int]) -> dict[int, Slope]:
    """The derivative of every node with respect to one of them."""
    slopes: dict[int, Slope] = {seed.id: seed.graph.constant(1.0)}
    for node in nodes:
        if node.id in constants:
            slopes.setdefault(node.id, None)
            continue
        if known := node.graph.slopes.get(node.id):
            argument, slope = known
            slopes[node.id] = _scaled(slopes[argument.id], slope)
            continue
        parts = [slopes[operand.id] for operand in node.operands]
        moves = any(part is not None for part in parts)
        slopes[node.id] = _slope(node, parts) if moves else None
    return slopes


def _slope(node: Value, parts: list[Slope]) -> Slope:
    rule = _RULES.get(node.operation)
    if rule is None:
        raise TypeError(f"no derivative of {node.operation}")
    return rule(node, *parts)


def _sum(a: Slope, b: Slope) -> Slope:
    if a is None or b is None:
        return b if a is None else a
    return a + b


def _scaled(slope: Slope, factor: Value) -> Slope:
    return None if slope is None else slope * factor


def _subtract(node: Value, a: Slope, b: Slope) -> Slope:
    return _sum(a, None if b is None else -b)


def _multiply(node: Value, a: Slope, b: Slope) -> Slope:
    left, right = node.operands
    if left is right:
        return _scaled(a, 2.0 * left)
    return _sum(_scaled(a, right), _scaled(b, left))


def _divide(node: Value, a: Slope, b: Slope) -> Slope:
    # One reciprocal, whatever the number of derivatives.
    above = _subtract(node, a, _scaled(b, node))
    return _scaled(above, 1.0 / node.operands[1])


def _select(node: Value, condition: Slope, yes: Slope, no: Slope) -> Slope:
    if yes is None and no is None:
        return None
    zero = node.graph.constant(0.0)
    return node.graph.select(
        node.operands[0], zero if yes is None else yes, zero if no is None else no
    )


def _absolute(node: Value, a: Slope) -> Slope:
    return None if a is None else node.graph.select(node.operands[0] < 0.0, -a, a)


def _none(node: Value, *parts: Slope) -> Slope:
    return None


_RULES: dict[str, Callable[..., Slope]] = {
    "add": lambda node, a, b: _sum(a, b),
    "subtract": _subtract,
    "multiply": _multiply,
    "divide": _divide,
    "negative": lambda node, a: None if a is None else -a,
    "absolute": _absolute,
    "square_root": lambda node, a: _scaled(a, 0.5 / node),
    "select": _select,
    "floor": _none,
    **dict.fromkeys(("less", "less_equal", "equal", "not_equal"), _none),
}
