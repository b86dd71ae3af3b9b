"""Elimination for small linear systems of known structure, as traced arithmetic."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from pma_gym.codegen.graph import Value

Entry = Value | None
"""A number of a matrix; None where it is zero whatever the numbers are."""

Solve = Callable[[Sequence[Entry]], list[Entry]]


def solver(
    jacobian: Sequence[Sequence[Entry]], part: Value
) -> Callable[[Sequence[Entry]], list[Value]]:
    """Factor I - part J; what comes back solves for right-hand sides.

    Gaussian elimination on the diagonal, in the order that fills in least (Markowitz 1957), but for
    the last two equations, which are solved by their determinant: one division, and no waiting for
    one unknown to find the other. Nothing is exchanged for size: the part is to be small enough
    that the diagonal leads. Where a state's own rate does not depend on it the pivot is 1.

    Args:
        jacobian: J, square.
        part: share of a step's length (s).
    Returns:
        A function of a right-hand side that gives the solution.
    """
    one = part.graph.constant(1.0)
    rows = [{j: -(part * v) for j, v in enumerate(row) if v is not None} for row in jacobian]
    for i, row in enumerate(rows):
        row[i] = one + row[i] if i in row else one
    steps: list[tuple[int, Value, dict[int, Value], dict[int, Value]]] = []
    left, ready = set(range(len(rows))), dict[int, Value]()
    while left and not (len(left) == 2 and not ready and _coupled(rows, left)):
        ready = ready or _inverses({i: rows[i][i] for i in _apart(rows, left)})
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
    last = _pair(rows, *sorted(left)) if left else None

    def solve(right: Sequence[Entry]) -> list[Value]:
        values = list(right)
        for pivot, _, _, down in steps:
            top = values[pivot]
            for i, factor in down.items():
                if top is not None:
                    values[i] = _less(values[i], factor * top)
        if last is not None:
            values = last(values)
        for pivot, inverse, across, _ in reversed(steps):
            solution = values[pivot]
            for j, value in across.items():
                below = values[j]
                if below is not None:
                    solution = _less(solution, value * below)
            values[pivot] = None if solution is None else solution * inverse
        zero = part.graph.constant(0.0)
        return [zero if value is None else value for value in values]

    return solve


def _inverses(pivots: Mapping[int, Value]) -> dict[int, Value]:
    """One over each number, at one division: the product of all is inverted and multiplied out.

    A division takes as long as eight multiplications or more.

    Args:
        pivots: the numbers, none of them so large or small that their product is no number.
    """
    inverses = {i: 1.0 / pivot for i, pivot in pivots.items() if pivot.is_constant}
    rest = [i for i in pivots if i not in inverses]
    if not rest:
        return inverses
    products = [pivots[rest[0]]]
    for i in rest[1:]:
        products.append(products[-1] * pivots[i])
    inverse = 1.0 / products[-1]
    for k in range(len(rest) - 1, 0, -1):
        inverses[rest[k]] = inverse * products[k - 1]
        inverse = inverse * pivots[rest[k]]
    inverses[rest[0]] = inverse
    return inverses


def _coupled(rows: Sequence[Mapping[int, Value]], left: Iterable[int]) -> bool:
    """Whether each of two equations has the other's unknown."""
    i, j = left
    return j in rows[i] and i in rows[j]


def _pair(rows: Sequence[Mapping[int, Value]], i: int, j: int) -> Solve:
    """Solves for the last two unknowns."""
    inverse = 1.0 / (rows[i][i] * rows[j][j] - rows[i][j] * rows[j][i])
    own, other = rows[j][j] * inverse, rows[i][j] * inverse
    back, last = rows[j][i] * inverse, rows[i][i] * inverse

    def solve(right: Sequence[Entry]) -> list[Entry]:
        values, (a, b) = list(right), (right[i], right[j])
        if a is not None or b is not None:
            above, below = (None if a is None else factor * a for factor in (own, back))
            values[i] = above if b is None else _less(above, other * b)
            beside = None if b is None else last * b
            values[j] = beside if below is None else _less(beside, below)
        return values

    return solve


def _apart(rows: Sequence[Mapping[int, Value]], left: set[int]) -> list[int]:
    """Pivots that elimination on each other leaves as they are."""
    free: list[int] = []
    for i in sorted(left, key=lambda i: _fill(rows, left, i)):
        if all(j not in rows[i] and i not in rows[j] for j in free):
            free.append(i)
    return free


def _less(value: Entry, change: Value) -> Value:
    return -change if value is None else value - change


def _fill(rows: Sequence[Mapping[int, Value]], left: set[int], pivot: int) -> int:
    """Products that elimination on a pivot costs."""
    across = sum(j in left and j != pivot for j in rows[pivot])
    down = sum(i != pivot and pivot in rows[i] for i in left)
    return across * down
