"""Methods of integration to compare with the one that is compiled: coefficients and single steps.

Those that are no Rosenbrock methods are prototypes in NumPy: their evaluations of the right-hand
side are counted, their time is not.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from benchmarks.rosenbrock import Method

Vector = NDArray[np.float64]
Rates = Callable[[Vector], Vector]

RODAS4 = Method(
    gamma=0.25,
    stages=(
        (),
        (1.544,),
        (0.9466785280815826, 0.2557011698983284),
        (3.314825187068521, 2.896124015972201, 0.9986419139977817),
        (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950),
        (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0),
    ),
    couplings=(
        (),
        (-5.6688,),
        (-2.430093356833875, -0.2063599157091915),
        (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
        (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
        (
            8.083246795921522,
            -7.981132988064893,
            -31.52159432874371,
            16.31930543123136,
            -6.058818238834054,
        ),
    ),
    weights=(
        1.221224509226641,
        6.019134481288629,
        12.53708332932087,
        -0.6878860361058950,
        1.0,
        1.0,
    ),
    errors=(0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
)
"""Order 4(3), six evaluations, L-stable and stiffly accurate (Hairer and Wanner, section VI.4)."""

GRK4T = Method(
    gamma=0.231,
    stages=((), (2.0,), (4.52470820736, 4.16352878860), None),
    couplings=(
        (),
        (-5.07167533877,),
        (6.02015272865, 0.159750684673),
        (-1.856343618677, -8.50538085819, -2.08407513602),
    ),
    weights=(3.95750374663, 4.62489238836, 0.617477263873, 1.282612945268),
    errors=(2.30215540292, 3.07363448539, -0.873280801802, -1.282612945268),
)
"""Order 4(3), three evaluations of the rates, A(89.3 deg)-stable.

Source: P. Kaps and P. Rentrop 1979; coefficients as in E. Hairer and G. Wanner, "Solving Ordinary
Differential Equations II", table IV.7.2, transformed as in their Eq. IV.7.25.
"""

ROS4L = Method(
    gamma=0.57282,
    stages=((), (2.0,), (1.867943637803922, 0.2344449711399156), None),
    couplings=(
        (),
        (-7.137615036412310,),
        (2.580708087951457, 0.6515950076447975),
        (-2.137148994382534, -0.3214669691237626, -0.6949742501781779),
    ),
    weights=(2.255570073418735, 0.2870493262186792, 0.4353179431840180, 1.093502252409163),
    errors=(-0.2815431932141155, -0.07276199124934920, -0.1082196201495311, -1.093502252409163),
)
"""Order 4(3), three evaluations, L-stable (Hairer and Wanner, table IV.7.2)."""


@dataclass(frozen=True)
class Stepper:
    """A method that makes single steps.

    Attributes:
        step: makes a step from the state, the rates, the rates' Jacobian and the step's size; gives
            the new state and its estimated error, None where it has none.
        evaluations: right-hand sides a step, a Jacobian counted as one more.
        exponent: power of the step's size that its estimated error goes with; 0 without estimate.
        stages: of those, evaluations without a Jacobian.
        overhead: operations a step beside them, at least, for so many states.
    """

    step: Callable[[Vector, Rates, Callable[[Vector], Vector], float], tuple[Vector, Vector | None]]
    evaluations: int
    exponent: int
    stages: int
    overhead: Callable[[int], int]


def explicit(
    rows: Sequence[Sequence[float]], weights: Sequence[float], embedded: Sequence[float] | None
) -> Callable[..., tuple[Vector, Vector | None]]:
    """An explicit Runge-Kutta method by its table."""

    def step(
        state: Vector, rates: Rates, _: Callable[[Vector], Vector], size: float
    ) -> tuple[Vector, Vector | None]:
        slopes: list[Vector] = []
        for row in rows:
            moved = state.copy()
            for factor, slope in zip(row, slopes, strict=True):
                moved += size * factor * slope
            slopes.append(rates(moved))
        new = state + size * sum(w * k for w, k in zip(weights, slopes, strict=True))
        if embedded is None:
            return new, None
        gaps = (w - e for w, e in zip(weights, embedded, strict=True))
        return new, np.asarray(size * sum(g * k for g, k in zip(gaps, slopes, strict=True)))

    return step


def exponential(
    state: Vector, rates: Rates, jacobian: Callable[[Vector], Vector], size: float
) -> tuple[Vector, Vector]:
    """A step of exprb43: exact for linear systems, with phi functions of the whole Jacobian.

    Source:
        M. Hochbruck, A. Ostermann and J. Schweitzer, "Exponential Rosenbrock-type methods", SIAM J.
        Numer. Anal. 47 (2009) 786, Eq. 5.6.
    """
    matrix, first = jacobian(state), rates(state)
    half, whole = _phis(0.5 * size * matrix, 1), _phis(size * matrix, 4)

    def beyond(moved: Vector) -> Vector:
        return rates(moved) - first - matrix @ (moved - state)

    second = beyond(state + 0.5 * size * half[1] @ first)
    third = beyond(state + size * whole[1] @ (first + second))
    low = state + size * (whole[1] @ first + whole[3] @ (16.0 * second - 2.0 * third))
    correction = size * whole[4] @ (12.0 * third - 48.0 * second)
    return low + correction, correction


def _phis(matrix: Vector, most: int) -> list[Vector]:
    """phi_0 to phi_most of a matrix, from the exponential of a larger one."""
    n = len(matrix)
    large = np.zeros((n * (most + 1), n * (most + 1)))
    large[:n, :n] = matrix
    for k in range(most):
        large[n * k : n * (k + 1), n * (k + 1) : n * (k + 2)] += np.eye(n)
    found = np.asarray(expm(large), float)
    return [np.asarray(found[:n, n * k : n * (k + 1)], float) for k in range(most + 1)]


_CLASSICAL = explicit([[], [0.5], [0.0, 0.5], [0.0, 0.0, 1.0]], [1 / 6, 1 / 3, 1 / 3, 1 / 6], None)
_LAST = [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]
_DORMAND_PRINCE = explicit(
    [
        [],
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
        _LAST,
    ],
    [*_LAST, 0.0],
    [5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40],
)

RK4 = Stepper(_CLASSICAL, 4, 0, 4, lambda n: 2 * 7 * n)
"""The classical method of order 4, at fixed steps."""

DORMAND_PRINCE = Stepper(_DORMAND_PRINCE, 6, 5, 6, lambda n: 2 * 26 * n)
"""Order 5(4); its last stage is the next step's first."""

_COUPLED, _PRODUCTS = 6, 25

EXPRB43 = Stepper(exponential, 4, 4, 3, lambda _: _PRODUCTS * 2 * _COUPLED**3)
"""Exponential Rosenbrock method of order 4(3): three evaluations and the Jacobian.

Its phi functions take 25 products of 6 by 6 matrices at least: 10 for a rational approximation, 5
for each of three doublings. The station couples six of its states; the sensors only follow.
"""
