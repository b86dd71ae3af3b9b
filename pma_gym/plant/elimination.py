"""Solves small systems of linear equations whose structure is known, as traced arithmetic."""

from collections.abc import Callable, Sequence

from pma_gym.kernels.graph import Value

Entry = Value | None
"""A number of a matrix; None where it is zero whatever the numbers are."""


def solver(matrix: Sequence[Sequence[Entry]]) -> Callable[[Sequence[Entry]], list[Value]]:
    """Factor a matrix; what comes back solves for right-hand sides.

    Gaussian elimination on the diagonal, in the order that fills in least (Markowitz 1957). Nothing
    is exchanged for size: made for I - h J with h small enough that the diagonal leads.

    Args:
        matrix: square, every diagonal entry present.
    Returns:
        A function of a right-hand side that gives the solution.
    """
    rows = [{j: v for j, v in enumerate(row) if v is not None} for row in matrix]
    steps: list[tuple[int, Value, dict[int, Value], dict[int, Value]]] = []
    left = set(range(len(rows)))
    ready: dict[int, Value] = {}
    while left:
        if not ready:
            ready = _first_inverses(rows, left)
        pivot = min(sorted(ready or left), key=lambda i: _fill(rows, left, i))
        left.discard(pivot)
        inverse = ready.pop(pivot) if pivot in ready else 1.0 / rows[pivot][pivot]
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


def _first_inverses(rows: list[dict[int, Value]], left: set[int]) -> dict[int, Value]:
    """Inverses of the pivots that elimination on each other leaves as they are, at one division.

    Divisions are what bounds a step's speed: the product of all is inverted and multiplied out.
    """
    free: list[int] = []
    for i in sorted(left, key=lambda i: _fill(rows, left, i)):
        if all(j not in rows[i] and i not in rows[j] for j in free):
            free.append(i)
    pivots = [rows[i][i] for i in free]
    plain = {i: p for i, p in zip(free, pivots, strict=True) if p.is_constant}
    rest = [i for i in free if i not in plain]
    found = {i: 1.0 / p for i, p in plain.items()}
    if not rest:
        return found
    products = [rows[rest[0]][rest[0]]]
    for i in rest[1:]:
        products.append(products[-1] * rows[i][i])
    inverse = 1.0 / products[-1]
    for k in range(len(rest) - 1, 0, -1):
        found[rest[k]] = inverse * products[k - 1]
        inverse = inverse * rows[rest[k]][rest[k]]
    found[rest[0]] = inverse
    return found


def _less(value: Entry, change: Value) -> Value:
    return -change if value is None else value - change


def _fill(rows: list[dict[int, Value]], left: set[int], pivot: int) -> int:
    """Products that elimination on a pivot costs."""
    across = sum(j in left and j != pivot for j in rows[pivot])
    down = sum(i != pivot and pivot in rows[i] for i in left)
    return across * down
