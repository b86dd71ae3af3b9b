"""Fit of a model's parameters to all measured trials at once.

The method is Levenberg-Marquardt least squares within the bounds of the catalogue. Each round
simulates every trial with the parameters and with a finite difference of each (`residuals`), and
needs only sums over the residuals. The first rounds use a few trials to come close; a simulation
without differences checks the last step.

Size of the differences: step-size control makes simulated trials jitter by some thousandths of the
sensors' noise when a parameter changes, however little. Each difference therefore changes the
measurements by `SHOWN` of their noise (root mean square over all residuals): far above the jitter,
and small enough for a negligible second derivative.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.threads.thread_pool import linear_algebra_alone
from pma_gym.data.trial import Trial
from pma_gym.estimation.least_squares import Fit, Round, inverse, least
from pma_gym.estimation.residuals import Residuals, Sums
from pma_gym.integrator.equations import Interpolation
from pma_gym.plant.compiled_model import DEFAULT_TOLERANCE
from pma_gym.plant.model import Model

__all__ = ["Fit", "Round", "fit"]

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

ROUGH = 100.0
"""All of these times so much for the first rounds, which use a few trials only."""

MISSED = 0.1
"""Tolerance of chi-square against the prediction of the last step, relative to the prediction and
to the mean per residual."""

FEW = 8
"""Number of trials in the first rounds, drawn by a fixed seed, if there are twice as many."""

MOST_ROUNDS = 50
_FIRST_DAMPING, _MOST_DAMPING = 1e-4, 1e12


def fit(
    model: Model,
    trials: Sequence[Trial],
    free: Sequence[str],
    threads: int = 1,
    tolerance: float = DEFAULT_TOLERANCE,
    interpolation: Interpolation = "foh",
    central: bool = False,
    progress: Callable[[Round], None] | None = None,
) -> Fit:
    """Fit a model to trials, starting from the model's values.

    The same input gives the same bits for every number of threads and cores.

    Args:
        model: the model.
        trials: measured trials; the sensor's noise weighs each quantity.
        free: paths of the free parameters, `effect.parameter_unit`.
        threads: number of threads.
        tolerance: tolerance of the integrator.
        interpolation: of the commands between rows: "foh" (first-order hold, linear) or "zoh" (each
            held until the next).
        central: use central differences, at twice the cost.
        progress: called after every round; an exception in it ends the fit.
    Raises:
        ModelError: a path that cannot be fitted.
        ValueError: the model cannot be simulated at its values, or trials without measurements.
    """

    def residuals(some: Sequence[Trial]) -> Residuals:
        return Residuals(model, some, free, tolerance, interpolation, threads)

    with linear_algebra_alone():
        few = residuals(_some(trials)) if len(trials) >= 2 * FEW else None
        rough = None if few is None else LevenbergMarquardt(few, central, ROUGH)
        if rough is not None:
            rough.run(progress)
        search = LevenbergMarquardt(residuals(trials), central, 1.0, rough)
        return search.result(search.run(progress))


def _some(trials: Sequence[Trial]) -> list[Trial]:
    chosen = np.random.Generator(np.random.Philox(0)).permutation(len(trials))[:FEW]
    return [trials[i] for i in sorted(chosen)]


class LevenbergMarquardt:
    """Levenberg-Marquardt iteration with its present state.

    Args:
        residuals: the trials.
        central: whether differences are central.
        rough: see `ROUGH`.
        before: an iteration over fewer trials, whose result is the start.

    Attributes:
        values: the best so far, in file units, shape (p,).
        best: the sums at it.
        damping: damping of the next step.
        rate: factor by which the last step lowered the expected gain of the next one.
        failures: number of successive steps that did not lower chi-square.
        rounds, simulated: as in `Fit`.
    """

    def __init__(
        self,
        residuals: Residuals,
        central: bool,
        rough: float,
        before: "LevenbergMarquardt | None" = None,
    ) -> None:
        self.residuals, self.central, self.rough = residuals, central, rough
        self.lower, self.upper = residuals.lower, residuals.upper
        self.damping, self.rate, self.failures = _FIRST_DAMPING, 1.0, 0
        self.rounds, self.simulated = 0, 0
        self.values: Array = np.clip(residuals.start, self.lower, self.upper)
        self.moves = FIRST_MOVE * self._scales(self.values)
        if before is not None:
            self.values, self.moves, self.rate = before.values, before.moves, before.rate
            self.rounds, self.simulated = before.rounds, before.simulated
        self.best = self._first_sums()
        if before is not None and not np.isfinite(self.best.chi_square):
            # What fits a few trials may balance no load in another.
            self.values = np.clip(residuals.start, self.lower, self.upper)
            self.best = self._first_sums()
        if not np.isfinite(self.best.chi_square):
            raise ValueError(
                f"model {residuals.plant.model.name} cannot be simulated where the fit begins: its "
                "muscle does not balance the load at the beginning of a trial, or it runs away"
            )

    @property
    def mean(self) -> float:
        """Mean squared residual, at least 1."""
        return max(1.0, self.best.chi_square / self.residuals.count)

    @property
    def surplus(self) -> float:
        """Excess of chi-square over noise."""
        return self.best.chi_square - self.residuals.count

    def run(self, progress: Callable[[Round], None] | None, most: int = MOST_ROUNDS) -> bool:
        """Iterate up to a number of rounds, and return whether the fit converged."""
        while self.rounds < most and self.damping < _MOST_DAMPING:
            if progress is not None:
                trials, best = self.residuals.trials, self.best.chi_square
                progress(Round(self.rounds, trials, best, self.named(self.values)))
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
        if promise < self.rough * max(CLOSE * self.mean, SHARE * self.surplus):
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
            return stuck and promise < self.rough * RUGGED * self.best.chi_square
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
        self.simulated += self.residuals.trials
        if not abs(self.best.chi_square - chi_square - promise) < MISSED * (promise + self.mean):
            return False
        self.values, self.best = tried, replace(self.best, chi_square=chi_square)
        return True

    def _sums(self, values: Array) -> Sums:
        self.rounds += 1
        self.simulated += self.residuals.trials * (1 + len(values) * (2 if self.central else 1))
        # Towards the inside where a bound is near.
        inward = values + self.moves > self.upper
        steps = np.where(inward, -self.moves, self.moves)
        sums = self.residuals.sums(values, steps, self.central)
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

    def _at_bound(self) -> NDArray[np.bool_]:
        """Parameters at a bound that blocks a further descent."""
        downhill = -self.best.gradient
        low = (self.values <= self.lower) & (downhill < 0.0)
        return low | (self.values >= self.upper) & (downhill > 0.0)

    def _step(self, damping: float) -> tuple[Array, float]:
        """The best step within the bounds, and by how much it should lower chi-square."""
        gradient, curvature = self.best.gradient, self.best.curvature
        room = self.lower - self.values, self.upper - self.values
        step = least(gradient, curvature, damping, *room)
        return step, float(-(2.0 * gradient @ step + step @ curvature @ step))

    def result(self, converged: bool) -> Fit:
        """Return the fit at the best parameters."""
        residuals, at_bound = self.residuals, self._at_bound()
        values, size = self.named(self.values), len(self.values)
        covariance = np.full((size, size), np.nan)
        loose = np.flatnonzero(~at_bound)
        surplus = max(1.0, self.best.chi_square / max(residuals.count - size, 1))
        part = np.ix_(loose, loose)
        covariance[part] = surplus * inverse(self.best.curvature[part])
        names, factors = [free.name for free in residuals.free], residuals.factors
        return Fit(
            model=residuals.plant.model.replace(values),
            parameters=dict(zip(names, (factors * self.values).tolist(), strict=True)),
            covariance=np.outer(factors, factors) * covariance,
            values=values,
            errors=self.named(np.sqrt(np.diag(covariance))),
            chi_square=self.best.chi_square,
            count=residuals.count,
            rounds=self.rounds,
            simulated=self.simulated,
            converged=converged,
            at_bounds=tuple(path for path, at in zip(values, at_bound, strict=True) if at),
        )
