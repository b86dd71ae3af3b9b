"""Least squares over a voltage sequence within limits, for a model that simulates 16 at once."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

Array = np.ndarray

Errors = Callable[[Array], Array]
"""Errors at points of a prediction, shape (plans, points), by plans, shape (plans, periods)."""

LENGTHS = np.array([1.0, 0.5, 0.25, 0.12, 0.05, 0.75, 1.25, 1.5])[:, None]
"""Lengths of a Gauss-Newton step that are tried, as shares of it."""

DIFFERENCE_V = 0.01
"""Difference of voltage from which slopes are taken (V), away from the nearer limit."""

ROUNDS = 3
"""Most Gauss-Newton steps."""

GAIN = 1e-3
"""Share by which a step must lower the sum of squares for another to be worth its time."""

TIE = 1e-9
"""Weight of a change's square beside an error's: where nothing follows from it, there is none."""


class Space(NamedTuple):
    """Search space: changes of a voltage sequence by blocks of periods.

    Attributes:
        blocks: block of every period, shape (periods,), 0, 0, 1, ... without gaps.
        low: least voltage (V).
        high: greatest voltage (V).
    """

    blocks: Array
    low: float
    high: float

    @property
    def starts(self) -> Array:
        """First period of every block, shape (blocks,)."""
        return np.flatnonzero(np.diff(self.blocks, prepend=-1))

    def changed(self, plan: Array, changes: Array) -> Array:
        """A plan with changes of its blocks, shape (n, blocks), held to the limits."""
        return (plan + changes[:, self.blocks]).clip(self.low, self.high)


def best_plan(errors: Errors, plan: Array, others: Array, space: Space) -> Array:
    """The plan of least squares near the best of several.

    Gauss-Newton: errors are linear in the plan near a plan, so that a step is a linear least
    squares problem within the limits. Of the step's lengths the best is taken. Limits, and a cable
    that may hang loose, make several valleys: the one of the best start is searched.

    Args:
        errors: errors by plans; one that is no number counts as infinite.
        plan: likely the best to begin with (V), shape (periods,): its slopes are taken at once.
        others: other plans to begin with, shape (plans, periods).
        space: what is searched.
    Returns:
        The plan, shape (periods,), never worse than any of those to begin with.
    """
    probe = _Probe(plan, space)
    starts = np.concatenate([plan[None, :], others])
    residuals = errors(np.concatenate([probe.plans, others]))
    own = len(probe.plans)
    sums = _sums(np.concatenate([residuals[:1], residuals[own:]]))
    best = int(sums.argmin())
    plan, least, residuals = starts[best], float(sums[best]), residuals[:own] if best == 0 else None
    for _ in range(ROUNDS):
        if residuals is None:
            probe = _Probe(plan, space)
            residuals = errors(probe.plans)
        tried = space.changed(plan, LENGTHS * probe.step(residuals))
        sums = _sums(errors(tried))
        best = int(sums.argmin())
        lower = float(sums[best])
        if not lower < least:
            break
        small = lower > (1.0 - GAIN) * least
        plan, least, residuals = tried[best], lower, None
        if small:
            break
    return plan


class _Probe:
    """A plan, those with one block changed, and the Gauss-Newton step that follows from them."""

    def __init__(self, plan: Array, space: Space) -> None:
        starts = space.starts
        lowest, highest = np.minimum.reduceat(plan, starts), np.maximum.reduceat(plan, starts)
        # As far as the last period of a block goes before its limit.
        self.low, self.high = space.low - highest, space.high - lowest
        middle = 0.5 * (space.low + space.high)
        self.away = np.where(0.5 * (lowest + highest) > middle, -DIFFERENCE_V, DIFFERENCE_V)
        changes = np.zeros((len(starts) + 1, len(starts)))
        changes[1:].flat[:: len(starts) + 1] = self.away
        self.plans = space.changed(plan, changes)

    def step(self, residuals: Array) -> Array:
        """The Gauss-Newton step by blocks, by the errors of the plans."""
        slopes = (residuals[1:] - residuals[0]) / self.away[:, None]
        square = slopes @ slopes.T
        square.flat[:: len(square) + 1] += TIE
        return _bounded(square, -slopes @ residuals[0], self.low, self.high)


def _sums(residuals: Array) -> Array:
    """Sums of squares, infinite for what is no number."""
    sums = (residuals * residuals).sum(axis=1)
    return np.where(np.isfinite(sums), sums, np.inf)


def _bounded(square: Array, right: Array, low: Array, high: Array) -> Array:
    """What solves square d = right, each entry held to a limit as soon as it passes it."""
    solution = np.linalg.solve(square, right)
    free = np.full(len(right), True)
    while True:
        beyond = free & ((solution < low) | (solution > high))
        if not beyond.any():
            return solution
        solution = solution.clip(low, high)
        free &= ~beyond
        if not free.any():
            return solution
        rest = right[free] - square[np.ix_(free, ~free)] @ solution[~free]
        solution[free] = np.linalg.solve(square[np.ix_(free, free)], rest)
