"""The integrator: an exponential Rosenbrock method of order 4, its exponentials quotients.

    y1 = y + h phi1(hJ) f(y) + 32/9 h phi3(hJ) D,   D = f(U) - f(y) - J (U - y)
    U  = y + 3/4 h phi1(3/4 hJ) f(y)
    phi1(z) = (e^z - 1) / z,   phi3(z) = (e^z - 1 - z - z^2 / 2) / z^3

J is the exact Jacobian at the step's start, differentiated from the laws themselves. What is linear
is solved by the exponential whatever its speed, so that cable and slide may swing once in a few
steps, and D, what is not linear, is small: it takes two evaluations of the rates.

No exponential of a matrix is computed. With W = (I - gamma hJ)^-1, whose equations are factored
once a step, every phi is a series in S = W - I:

    phi(hJ) = sum_k b_k S^k W,   b_k = sum_j (-1)^(k-j) binomial(k, j) f_j / gamma^j

for phi(z) = sum_j f_j z^j. As many terms are taken as are worth their solution. S is of the size of
gamma hJ where that is small, and -I where it is large: what is fast and damped dies away.

Source:
    V. T. Luan 2017, "Fourth-order two-stage explicit exponential integrators for time-dependent
    PDEs", Applied Numerical Mathematics 112, for the method; S. P. Norsett 1975, "C-polynomials for
    rational approximation to the exponential function", Numerische Mathematik 25, for quotients
    with one pole. Neither was at hand: tests hold the order and the coefficients.

Elimination for small linear systems of known structure, as traced arithmetic.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import comb, factorial

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.graph import Value
from pma_gym.codegen.trace import substitute
from pma_gym.integrator.equations import State

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


GAMMA = Fraction(17, 100)
"""Pole of the quotients. With six terms it damps what swings up to 84 degrees from the real axis,
leaves 0.46 of what is infinitely fast, and the error of e^z is 1.4e-5 z^7."""

TERMS, STAGE_TERMS, BENT_TERMS = 6, 2, 2
"""Terms of phi1 in y1, in U and of phi3: orders 6, 2 and, for D is of order 2, 4."""

STAGE = Fraction(3, 4)
"""Where in the step U is: with it the method is of order 4."""

HALF_TERMS = 5
"""Terms of what the states are after half of a step: where it may have turned and turned back."""

BENT_SHARE, LINEAR_SHARE = 0.6, 0.6
"""How much of what D changes, and of the last term of phi1, counts as a step's error. Both are of
lower order than the method. Under random actions true errors of steps were an eighth of it in the
median, a thirtieth to a half in eight of ten."""


def series(order: int, share: Fraction, terms: int) -> list[float]:
    """The b_k of share phi(share z), divided by gamma.

    Args:
        order: of phi.
        share: of the step.
        terms: how many.

    >>> series(1, Fraction(1), 3) == [float(b / GAMMA) for b in (1, 1 / (2 * GAMMA) - 1,
    ...     1 / (6 * GAMMA**2) - 1 / GAMMA + 1)]
    True
    """
    z = [share ** (j + 1) / (factorial(j + order) * GAMMA**j) for j in range(terms)]
    return [
        float(sum((-1) ** (k - j) * comb(k, j) * z[j] for j in range(k + 1)) / GAMMA)
        for k in range(terms)
    ]


PHI, STAGE_PHI = series(1, Fraction(1), TERMS), series(1, STAGE, STAGE_TERMS)
HALF_PHI = series(1, Fraction(1, 2), HALF_TERMS)
BENT_PHI = [2.0 / float(STAGE) ** 2 * b for b in series(3, Fraction(1), BENT_TERMS)]


@dataclass(frozen=True)
class Step:
    """One step, as values.

    Attributes:
        states: states at its end.
        errors: estimated error of each state.
        visited: states on the way.
    """

    states: list[Value]
    errors: list[Value]
    visited: list[list[Value]]


def step(
    states: Sequence[State],
    size: Value,
    frozen: Mapping[int, Value],
    here: Mapping[int, Value],
) -> Step:
    """A step of a system.

    Args:
        states: its states.
        size: size of the step h (s).
        frozen: values by id for the whole step, such as where it began.
        here: simpler values by id that hold at its beginning.
    """
    values, rates = [s.value for s in states], [s.rate for s in states]
    jacobian = substituted(derivatives(rates, values), {**frozen, **here})
    first = substitute(rates, {**frozen, **here})
    part = float(GAMMA) * size
    solve = solver(jacobian, part)

    def next_term(term: list[Value]) -> list[Value]:
        """S times a term."""
        return [u - old for u, old in zip(solve(term), term, strict=True)]

    # gamma S^k W h f(y), by k.
    terms = [solve([part * rate for rate in first])]
    while len(terms) < TERMS:
        terms.append(next_term(terms[-1]))
    across = list(zip(*terms, strict=True))
    moved = [total(None, STAGE_PHI, own[:STAGE_TERMS]) for own in across]
    stage = [value + change for value, change in zip(values, moved, strict=True)]
    there = {value.id: new for value, new in zip(values, stage, strict=True)}
    second = substitute(rates, {**frozen, **there})
    # gamma W h D = W (gamma h (f(U) - f(y)) - (U - y)) + (U - y) needs no product with J.
    triples = zip(second, first, moved, strict=True)
    bent = solve([part * (after - before) - change for after, before, change in triples])
    bends = [[u + change for u, change in zip(bent, moved, strict=True)]]
    while len(bends) < BENT_TERMS:
        bends.append(next_term(bends[-1]))
    corrections = [total(None, BENT_PHI, own) for own in zip(*bends, strict=True)]
    last = LINEAR_SHARE * PHI[-1]
    return Step(
        states=[
            total(value + correction, PHI, own)
            for value, correction, own in zip(values, corrections, across, strict=True)
        ],
        errors=[
            BENT_SHARE * correction + last * own[-1]
            for correction, own in zip(corrections, across, strict=True)
        ],
        visited=[
            [total(v, HALF_PHI, own[:HALF_TERMS]) for v, own in zip(values, across, strict=True)],
            stage,
        ],
    )


def substituted(
    jacobian: list[list[Entry]], replacements: Mapping[int, Value]
) -> list[list[Entry]]:
    """A matrix with values in the place of others, by id."""
    present = [entry for row in jacobian for entry in row if entry is not None]
    results = iter(substitute(present, replacements))
    return [[None if entry is None else next(results) for entry in row] for row in jacobian]


def total(start: Value | None, factors: Sequence[Value | float], values: Sequence[Value]) -> Value:
    """A value and the products of others with factors."""
    result = start
    for factor, value in zip(factors, values, strict=True):
        result = factor * value if result is None else result + factor * value
    assert result is not None
    return result
