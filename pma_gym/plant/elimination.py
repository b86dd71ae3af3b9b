"""Solves small systems of linear equations whose structure is known, as traced arithmetic."""

from collections.abc import Callable, Sequence

from pma_gym.kernels.graph import Value

Entry = Value | None
"""A number of a matrix; None where it is zero whatever the numbers are."""


def solver(
    jacobian: Sequence[Sequence[Entry]], part: Value
) -> Callable[[Sequence[Entry]], list[Value]]:
    """Factor I / part - J; what comes back solves for right-hand sides.

    Gaussian elimination on the diagonal, in the order that fills in least (Markowitz 1957). Nothing
    is exchanged for size: the part is to be small enough that the diagonal leads.

    Args:
        jacobian: J, square.
        part: share of a step's length (s).
    Returns:
        A function of a right-hand side that gives the solution.
    """
    rows = [{j: -v for j, v in enumerate(row) if v is not None} for row in jacobian]
    one = part.graph.constant(1.0)
    scaled = {}
    for i, row in enumerate(rows):
        own = row.get(i)
        row[i] = 1.0 / part if own is None else 1.0 / part + own
        scaled[row[i].id] = one if own is None else one + part * own
    steps: list[tuple[int, Value, dict[int, Value], dict[int, Value]]] = []
    left = set(range(len(rows)))
    ready: dict[int, Value] = {}
    while left:
        if not ready:
            pivots = {i: rows[i][i] for i in _apart(rows, left)}
            if len(pivots) == 1:
                ready = {i: 1.0 / pivot for i, pivot in pivots.items()}
            else:
                ready = _inverses({i: scaled.get(p.id, part * p) for i, p in pivots.items()}, part)
        pivot = min(sorted(ready), key=lambda i: _fill(rows, left, i))
        left.discard(pivot)
        inverse = ready.pop(pivot)
        across = {j: v for j, v in rows[pivot].items() if j in left}
        down = {}
        for i in sorted(left):
            if pivot in rows[i]:
                down[i] = rows[i].pop(pivot) * inverse
                for j, value in across.items():
                    change = down[i] * value
                    rows[i][j] = rows[i][j] - change if j in rows[i] else -change
        steps.append((pivot, inverse, across, down))

    def solve(right: Sequence[Entry]) -> list[Value]:
        values = list(right)
        for pivot, _, _, down in steps:
            top = values[pivot]
            for i, factor in down.items():
                if top is not None:
                    values[i] = _less(values[i], factor * top)
        for pivot, inverse, across, _ in reversed(steps):
            total = values[pivot]
            for j, value in across.items():
                below = values[j]
                if below is not None:
                    total = _less(total, value * below)
            values[pivot] = None if total is None else total * inverse
        zero = steps[0][1].graph.constant(0.0)
        return [zero if value is None else value for value in values]

    return solve


def _apart(rows: list[dict[int, Value]], left: set[int]) -> list[int]:
    """Pivots that elimination on each other leaves as they are."""
    free: list[int] = []
    for i in sorted(left, key=lambda i: _fill(rows, left, i)):
        if all(j not in rows[i] and i not in rows[j] for j in free):
            free.append(i)
    return free


def _inverses(scaled: dict[int, Value], part: Value) -> dict[int, Value]:
    """Inverses of pivots, which are given times a part of a step, at one division.

    Divisions are what bounds a step's speed: the product of all is inverted and multiplied out.
    Times the part, pivots are near 1, so that their product is a number in single precision too.
    """
    found = {i: part / pivot for i, pivot in scaled.items() if pivot.is_constant}
    rest = [i for i in scaled if i not in found]
    if not rest:
        return found
    products = [scaled[rest[0]]]
    for i in rest[1:]:
        products.append(products[-1] * scaled[i])
    inverse = part / products[-1]
    for k in range(len(rest) - 1, 0, -1):
        found[rest[k]] = inverse * products[k - 1]
        inverse = inverse * scaled[rest[k]]
    found[rest[0]] = inverse
    return found


def _less(value: Entry, change: Value) -> Value:
    return -change if value is None else value - change


def _fill(rows: list[dict[int, Value]], left: set[int], pivot: int) -> int:
    """Products that elimination on a pivot costs."""
    across = sum(j in left and j != pivot for j in rows[pivot])
    down = sum(i != pivot and pivot in rows[i] for i in left)
    return across * down
