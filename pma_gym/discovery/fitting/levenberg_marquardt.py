"""Levenberg-Marquardt least squares over all measured trials at once, within bounds.

Each round simulates every trial with the parameters and with a finite difference of each, and
needs only sums over the residuals. A simulation without differences checks the last step.

Size of the differences: step-size control makes simulated trials jitter by some thousandths of the
sensors' noise when a parameter changes, however little. Each difference therefore changes the
measurements by `SHOWN` of their noise (root mean square over all residuals): far above the jitter,
and small enough for a negligible second derivative.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.preparation.whitened_residuals import Sums, WhitenedResiduals
from pma_gym.estimation.least_squares import least

Array = NDArray[np.float64]

SHOWN = 0.3
"""Change of the measurements by a finite difference, in their standard deviations."""

TINY = 1e6
"""A hundredth of a range over a value, from which on the range is no scale for it."""

FIRST_MOVE, LEAST_MOVE, MOST_MOVE = 1e-3, 1e-6, 2e-2
"""First, least and largest such move, as a share of the parameter's value, or of its bounds' width
where it is near 0."""

BOUNDLESS = 3000.0
"""How many times a parameter's value a hundredth of its bounds' width is, from which on the bounds
of what is positive say nothing of its scale."""

FARTHER = 1e3
"""A hundredth of a range over a value, from which on the least move is a share of so many times the
value, and not of the range."""

SHARES, TOO_MUCH = (1e-2, 1e-4, 1e-6), 100.0
"""Shares of the first moves that are tried where larger ones lead to what cannot be simulated, or
change the measurements by more than so many times what is left of them."""

CLOSE = 1e-3
"""A fit has converged when a further step would lower chi-square, counted in its mean per residual,
by less than this: the parameters are within sqrt(CLOSE) = 3 % of a standard error of the best."""

SHARE = 1e-5
"""It has as well when the step would lower what chi-square has beyond noise by less than this
share. A standard error takes residuals for independent, which those of a wrong model are not."""

RUGGED, FAILURES = 1e-4, 3
"""Beside a wrong model chi-square itself is rugged, as stick and slip and the jerks of a tightening
cable come at other instants. When so many steps in a row fail to lower it, although they should by
less than such a share, the fit has converged too."""

MISSED = 0.1
"""Tolerance of chi-square against the prediction of the last step, relative to the prediction and
to the mean per residual."""

_FIRST_DAMPING, _MOST_DAMPING = 1e-4, 1e12


class LevenbergMarquardt:
    """Levenberg-Marquardt iteration with its present state.

    Args:
        residuals: the trials beside the model.

    Attributes:
        values: the best so far, in file units, shape (p,).
        best: the sums at it.
        damping: damping of the next step.
        rate: factor by which the last step lowered the expected gain of the next one.
        failures: number of successive steps that did not lower chi-square.
        rounds: number of rounds, each with all finite differences.

    Raises:
        ValueError: the model cannot be simulated at its values.
    """

    def __init__(self, residuals: WhitenedResiduals) -> None:
        self.residuals = residuals
        self.lower, self.upper = residuals.lower, residuals.upper
        self.damping, self.rate, self.failures, self.rounds = _FIRST_DAMPING, 1.0, 0, 0
        self.values: Array = np.clip(residuals.start, self.lower, self.upper)
        self.moves = FIRST_MOVE * self._scales(self.values)
        self.best = self._first_sums()
        if not np.isfinite(self.best.chi_square):
            raise ValueError("the model cannot be simulated where the fit begins")

    @property
    def mean(self) -> float:
        """Mean squared residual, at least 1."""
        return max(1.0, self.best.chi_square / self.residuals.count)

    @property
    def surplus(self) -> float:
        """Excess of chi-square over noise."""
        return self.best.chi_square - self.residuals.count

    def run(self, most: int) -> bool:
        """Iterate up to a number of rounds, and return whether the fit converged."""
        while self.rounds < most and self.damping < _MOST_DAMPING:
            if self.advance():
                return True
        return False

    def named(self, values: Array) -> dict[str, float]:
        """Numbers by path."""
        paths = [parameter.path for parameter in self.residuals.free]
        return {path: float(value) for path, value in zip(paths, values, strict=True)}

    def advance(self) -> bool:
        """Make one step, and return whether the fit has converged."""
        step, promise = self._step(0.0)
        if promise < max(CLOSE * self.mean, SHARE * self.surplus):
            return True
        if self.rate * promise < CLOSE * self.mean and self._last(step, promise):
            return True
        damped, gain = self._step(self.damping)
        tried = np.clip(self.values + damped, self.lower, self.upper)
        sums = self._sums(tried)
        lowered = self.best.chi_square - sums.chi_square
        if not lowered > 0.0:
            self.damping = max(10.0 * self.damping, _FIRST_DAMPING)
            self.failures += 1
            stuck = self.failures >= FAILURES
            return stuck and promise < RUGGED * self.best.chi_square
        if lowered > 0.5 * gain:
            self.damping *= 0.1
        elif lowered < 0.1 * gain:
            self.damping *= 5.0
        self.values, self.best, self.failures = tried, sums, 0
        self.rate = self._step(0.0)[1] / promise
        return False

    def _first_sums(self) -> Sums:
        """Sums at the beginning, by smaller moves where the first ones lead to another rig there.

        Twice a damping that differs by direction may drive what it slows down.
        """
        first = moves = self.moves
        sums = self._sums(self.values)
        for share in SHARES:
            left = np.sqrt(max(sums.chi_square, self.residuals.count))
            changed = np.sqrt(np.abs(np.diag(sums.curvature))) * moves
            if np.isfinite(sums.chi_square) and np.all(changed <= TOO_MUCH * left):
                break
            self.moves = moves = share * first
            sums = self._sums(self.values)
        return sums

    def _last(self, step: Array, promise: float) -> bool:
        """Take a step after which none should be needed; whether chi-square falls as promised."""
        tried = np.clip(self.values + step, self.lower, self.upper)
        chi_square = self.residuals.sums(tried, np.empty(0)).chi_square
        if not abs(self.best.chi_square - chi_square - promise) < MISSED * (promise + self.mean):
            return False
        self.values, self.best = tried, replace(self.best, chi_square=chi_square)
        return True

    def _sums(self, values: Array) -> Sums:
        self.rounds += 1
        # Towards the inside where a bound is near.
        inward = values + self.moves > self.upper
        steps = np.where(inward, -self.moves, self.moves)
        sums = self.residuals.sums(values, steps)
        if np.isfinite(sums.chi_square):
            self.moves = self._next_moves(values, sums)
        return sums

    def _next_moves(self, values: Array, sums: Sums) -> Array:
        shown = np.sqrt(np.diag(sums.curvature) / self.residuals.count)
        scales = self._scales(values)
        least = np.where(values != 0.0, np.minimum(FARTHER * np.abs(values), scales), scales)
        with np.errstate(divide="ignore"):
            return np.clip(SHOWN / shown, LEAST_MOVE * least, MOST_MOVE * scales)

    def _scales(self, values: Array) -> Array:
        width = 1e-2 * (self.upper - self.lower)
        # A limit may be anything up to one that is never reached; its own size is its scale.
        boundless = (self.lower > 0.0) & (width > BOUNDLESS * np.abs(values))
        # What a crane may have says nothing of a watch.
        far = (values != 0.0) & (width > TINY * np.abs(values))
        width = np.where(far, np.maximum(np.abs(values) * np.sqrt(TINY), width / TINY**2), width)
        return np.where(boundless, np.abs(values), np.maximum(np.abs(values), width))

    def _step(self, damping: float) -> tuple[Array, float]:
        """The best step within the bounds, and by how much it should lower chi-square."""
        gradient, curvature = self.best.gradient, self.best.curvature
        room = self.lower - self.values, self.upper - self.values
        step = least(gradient, curvature, damping, *room)
        return step, float(-(2.0 * gradient @ step + step @ curvature @ step))
