"""A small quadratic program within limits, solved by OSQP where the limits matter."""

from typing import Any

import numpy as np
from scipy.linalg import get_lapack_funcs

ACCURACY = 1e-5
"""Accuracy that OSQP is asked for, absolute (V) and relative."""

MOST_ITERATIONS = 2000

Problem = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Entries of H's upper triangle, q, low and high."""


class BoundedProgram:
    """Minimise v' H v / 2 + q' v with low <= v <= high, repeatedly with other numbers.

    If what minimises without limits keeps them, it is the answer, and found as the solution of
    H v = -q. Else OSQP searches, from the last answer on. It is set up when it is first needed and
    counts iterations, never time, so that the same problems in the same order have the same
    answers to the last bit, on a busy machine too. A copy, or one from a pickle, has no solver of
    its own until it needs one: then it solves the problems of the original again, in their order,
    and so goes on with the same bits.

    Args:
        count: how many variables.

    Attributes:
        limited: how many problems needed OSQP.
        failures: how many of them it did not solve.

    Source:
        B. Stellato et al. 2020, "OSQP: an operator splitting solver for quadratic programs".
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self.limited = self.failures = 0
        self._problems: list[Problem] = []
        self._prepare()

    def _prepare(self) -> None:
        """Make what no copy can hold."""
        self.osqp = imported_osqp()
        self._solver: Any = None
        (self._positive_solve,) = get_lapack_funcs(("posv",))
        # OSQP wants the upper triangle, column by column.
        self._columns, self._rows = np.tril_indices(self._count)

    def __getstate__(self) -> tuple[int, int, int, list[Problem]]:
        """What a copy is made from: the counts, and the problems that OSQP was given."""
        return self._count, self.limited, self.failures, list(self._problems)

    def __setstate__(self, state: tuple[int, int, int, list[Problem]]) -> None:
        """Go on where the original stood."""
        self._count, self.limited, self.failures, self._problems = state
        self._prepare()

    def solve(
        self, square: np.ndarray, linear: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> np.ndarray | None:
        """The v of least v' H v / 2 + q' v, shape (n,); None if OSQP does not find it.

        Args:
            square: H, symmetric and positive definite, shape (n, n).
            linear: q, shape (n,).
            low: shape (n,).
            high: shape (n,).
        """
        _, free, failed = self._positive_solve(square, -linear)
        if not failed and np.all((low <= free) & (free <= high)):
            return free
        self.limited += 1
        optimum = self._searched(square, linear, low, high)
        if optimum is None:
            self.failures += 1
        return optimum

    def _searched(
        self, square: np.ndarray, linear: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> np.ndarray | None:
        entries = square[self._rows, self._columns]
        self._problems.append((entries, linear.copy(), low.copy(), high.copy()))
        unsolved = self._problems if self._solver is None else self._problems[-1:]
        result = [self._solved(*problem) for problem in unsolved][-1]
        if result.info.status_val != self.osqp.SolverStatus.OSQP_SOLVED:
            return None
        # OSQP keeps limits to its accuracy only.
        return np.clip(result.x, low, high)

    def _solved(
        self, entries: np.ndarray, linear: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> Any:  # noqa: ANN401
        if self._solver is None:
            self._solver = self._set_up(entries, linear, low, high)
        else:
            self._solver.update(Px=entries, q=linear, l=low, u=high)
        return self._solver.solve(raise_error=False)

    def _set_up(
        self, entries: np.ndarray, linear: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> Any:  # noqa: ANN401
        from scipy import sparse

        count = len(linear)
        square = sparse.csc_matrix((entries, (self._rows, self._columns)), (count, count))
        solver = self.osqp.OSQP(algebra="builtin")
        solver.setup(
            *(square, linear, sparse.identity(count, format="csc"), low, high),
            verbose=False,
            eps_abs=ACCURACY,
            eps_rel=ACCURACY,
            max_iter=MOST_ITERATIONS,
            check_termination=5,
            # By iterations: the default of other versions measures time.
            adaptive_rho=1,
            adaptive_rho_interval=25,
            warm_starting=True,
        )
        return solver


def imported_osqp() -> Any:  # noqa: ANN401
    """The module osqp.

    Raises:
        ImportError: it is not installed; says how to install it.
    """
    try:
        import osqp
    except ImportError as error:
        raise ImportError(
            "the controller mpc needs osqp, which is not installed: pip install pma-gym[mpc] "
            "(in a clone: pip install -e .[mpc])"
        ) from error
    return osqp
