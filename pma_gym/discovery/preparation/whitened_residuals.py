"""Measured trials beside a model: whitened residuals, and sums of them that are small.

Residuals are simulated less measured, made white by each signal's noise; the zeros of contraction
and rotation are free in every trial and projected out. Sums are kept for pieces of a quarter of a
second, so that trials can be left out, and chance be simulated by turning the signs of pieces,
without another simulation.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.assumed_range import (
    assumed_range,
    at_assumed_edge,
    needed_reach,
)
from pma_gym.discovery.preparation.noise import Whitening
from pma_gym.discovery.preparation.nuisance_projection import Projection, projection
from pma_gym.discovery.thresholds import INDEPENDENT_S
from pma_gym.estimation.logged import Logged
from pma_gym.estimation.simulated_trials import SimulatedTrials
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

ROWS = 256
"""Rows in one product of matrices: few enough that no BLAS shares it between threads."""


@dataclass(frozen=True)
class Pieces:
    """Products of columns, over pieces of trials.

    Attributes:
        products: shape (pieces, columns, columns); column 0 is the residual.
        trial: which trial each piece belongs to, shape (pieces,).
        counts: how many readings each has, shape (pieces,).
    """

    products: Array
    trial: NDArray[np.int64]
    counts: NDArray[np.int64]

    def total(self, trials: Sequence[int] | None = None) -> Array:
        """Products over some trials, or all; shape (columns, columns)."""
        if trials is None:
            return self.products.sum(axis=0)
        return self.products[np.isin(self.trial, trials)].sum(axis=0)

    def readings(self, trials: Sequence[int] | None = None) -> int:
        """How many readings some trials have, or all."""
        if trials is None:
            return int(self.counts.sum())
        return int(self.counts[np.isin(self.trial, trials)].sum())


@dataclass(frozen=True)
class Sums:
    """Sums over the residuals r of all trials, in units of the noise; J = dr / d(parameters).

    Attributes:
        chi_square: r.r; infinite if the model cannot be simulated.
        gradient: J^T r, shape (p,), per file unit.
        curvature: J^T J, shape (p, p).
    """

    chi_square: float
    gradient: Array
    curvature: Array


class WhitenedResiduals(SimulatedTrials):
    """Trials beside a model with free parameters, whitened; what a search may lower.

    Args:
        model: the model.
        trials: the trials.
        free: paths of its free parameters.
        noise: whitening of each output.
        prior: standard deviations of the free parameters about `centre`, in file units; infinite
            for one that may be anything.
        centre: what they are expected to be; the model's own values if not given.
        own: values (SI) that a parameter has in each trial, by path.
        threads: as `SimulatedTrials`.
        reach: how many times as wide as assumed beforehand the range of a parameter is, by path.
        lowest: least values (file unit) of parameters that the trials can show, by path.
        highest: largest values, likewise.

    Attributes:
        noise, prior, centre: as given.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        free: Sequence[str],
        noise: Sequence[Whitening],
        prior: Array,
        centre: Array | None = None,
        own: Mapping[str, Sequence[float]] | None = None,
        threads: int = 1,
        reach: Mapping[str, float] | None = None,
        lowest: Mapping[str, float] | None = None,
        highest: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(model, trials, free, threads)
        self.noise, self.prior = tuple(noise), np.asarray(prior, float)
        self.centre = self.start.copy() if centre is None else np.asarray(centre, float)
        least = np.array([(lowest or {}).get(path, -np.inf) for path in free])
        most = np.array([(highest or {}).get(path, np.inf) for path in free])
        self._possible = np.maximum(self.lower, least), np.minimum(self.upper, most)
        wider = np.array([(reach or {}).get(path, 1.0) for path in free])
        # Beyond lies no rig like this one, and an integrator's hell: a slide of a gram, say.
        self.lower, self.upper = assumed_range(self.centre, self.prior, *self._possible, wider)
        self._own = self._indices(own or {})
        self._projections: dict[tuple[int, int], Projection] = {}
        self._constants: dict[tuple[int, int], tuple[Array, float]] = {}

    @property
    def logged(self) -> list[Logged]:
        """The trials as they are read."""
        return self._trials

    def at_assumed_edge(self, values: Array) -> list[str]:
        """Paths of parameters that are at an edge of what was assumed of them beforehand."""
        at = at_assumed_edge(values, self.lower, self.upper, *self._possible)
        return [free.path for free, edge in zip(self.free, at, strict=True) if edge]

    def needed_reach(self, values: Array) -> dict[str, float]:
        """How many times as wide as assumed the ranges that do not hold values must be, by path."""
        wider = needed_reach(values, self.centre, self.prior, *self._possible)
        pairs = zip(self.free, wider.tolist(), strict=True)
        return {free.path: reach for free, reach in pairs if reach > 1.0}

    def sums(self, values: Array, steps: Array) -> Sums:
        """Sums over whitened residuals, with what the prior adds."""
        moved_products = self._moved_products(values, steps, False, self._product)
        total = np.sum(moved_products, axis=0) if moved_products else np.full((1, 1), np.nan)
        if not np.isfinite(total).all():
            size = len(steps)
            return Sums(math.inf, np.full(size, np.nan), np.full((size, size), np.nan))
        away = (values - self.centre) / self.prior
        chi_square = float(total[0, 0] + away @ away)
        if not steps.size:
            return Sums(chi_square, np.empty(0), np.empty((0, 0)))
        gradient = total[1:, 0] + away / self.prior
        return Sums(chi_square, gradient, total[1:, 1:] + np.diag(self.prior**-2.0))

    def pieces(self, values: Array, steps: Array, central: bool = False) -> Pieces | None:
        """Products of the residual and its derivatives by the parameters (per file unit).

        None where the model cannot be simulated.
        """
        return self.gathered(self._moved_products(values, steps, central, self._products))

    def _moved_products(
        self,
        values: Array,
        steps: Array,
        central: bool,
        products: Callable[[Logged, Array], Array],
    ) -> list[Array]:
        """What `products` makes of each trial's whitened residual and its derivatives."""
        moves = np.diag(steps) if steps.size else np.empty((0, len(values)))
        tried = np.concatenate([values[None], values + moves, *([values - moves] * central)])
        widths = np.concatenate([[1.0], steps])

        def work(logged: Logged, states: Array, zeros: Array, vectors: Array) -> Array:
            differences = self._differences(logged, states, zeros, vectors, central)
            # A rig that cannot be simulated has no finite products; who asks for them looks.
            with np.errstate(invalid="ignore", over="ignore"):
                white = self.whitened(logged, differences)
                return products(logged, white / widths[:, None, None])

        return self._each(tried, work)

    def _differences(
        self, logged: Logged, states: Array, zeros: Array, vectors: Array, central: bool
    ) -> Array:
        """Simulated minus measured, then what moving each parameter changes (SI).

        Shape (1 + p, signals, rows).
        """
        readings = self._held(states, zeros, vectors, logged.channels)
        moved = (len(states) - 1) // 2 if central else len(states) - 1
        differences = np.zeros((1 + moved, *logged.measured.shape))
        for channel in logged.channels:
            signal, there = readings[channel], differences[:, channel]
            np.subtract(signal[0], logged.measured[channel], out=there[0])
            if central:
                np.subtract(signal[1 : 1 + moved], signal[1 + moved :], out=there[1:])
                there[1:] *= 0.5
            else:
                np.subtract(signal[1:], signal[0], out=there[1:])
            there[:, logged.missing[channel]] = 0.0
        return differences

    def columns(self, tried: Array) -> list[Any] | None:
        """Whitened residual at the first of some parameters, and what the others change.

        Shape (tried, signals, rows) for each trial, single precision; None where it cannot be
        simulated.
        """

        def work(logged: Logged, states: Array, zeros: Array, vectors: Array) -> Any:  # noqa: ANN401
            differences = self._differences(logged, states, zeros, vectors, central=False)
            return self.whitened(logged, differences).astype(np.float32)

        columns = self._each(tried, work)
        if not self._settled or not all(np.isfinite(part).all() for part in columns):
            return None
        return columns

    def readings(self, values: Array) -> list[Array] | None:
        """What the sensors hold at parameters (SI), shape (signals, rows) for each trial."""

        def work(logged: Logged, states: Array, zeros: Array, vectors: Array) -> Array:
            return np.stack([signal[0] for signal in self._held(states, zeros, vectors)])

        readings = self._each(values[None], work)
        return readings if self._settled else None

    def first_states(self, values: Array) -> list[Array]:
        """States (SI) in which each trial begins at parameters, shape (states,) for each trial."""

        def work(logged: Logged, states: Array, zeros: Array, vectors: Array) -> Array:
            return states[0, 0].copy()

        return self._each(values[None], work)

    def _in_noise(self, logged: Logged, left: Array) -> Array:
        """Differences (SI), shape (tried, signals, rows), whitened, free of free zeros and flat."""
        # A rig that cannot be simulated has no finite ones; who asks for them looks.
        with np.errstate(invalid="ignore", over="ignore"):
            return self.whitened(logged, left).reshape(len(left), -1)

    def whitened(self, logged: Logged, differences: Array) -> Array:
        """Differences (SI), shape (columns, signals, rows), made white and free of free zeros."""
        white = np.zeros_like(differences)
        signals = zip(logged.signals, self.noise, strict=True)
        for channel, (signal, noise) in enumerate(signals):
            if not logged.measures[channel]:
                continue
            missing = logged.missing[channel]
            filtered = noise.white(differences[:, channel], missing)
            if noise.has_nuisances:
                self._projection(logged, channel).out_of(filtered)
            elif signal.has_free_zero:
                along, size = self._constant(logged, channel)
                filtered -= np.outer(filtered @ along / size, along)
            white[:, channel] = filtered
        return white

    def _constant(self, logged: Logged, channel: int) -> tuple[Array, float]:
        """What a constant is when it is whitened, shape (rows,), and its square; made once."""
        key = (id(logged), channel)
        if key not in self._constants:
            along = self.noise[channel].white(logged.counts[channel], logged.missing[channel])
            self._constants[key] = along, float(along @ along)
        return self._constants[key]

    def without_nuisances(self, logged: Logged, left: Array) -> Array:
        """Simulated less measured (SI), NaN where there is none, less lines and drifts in it.

        Shape (signals, rows).
        """
        rest = left.copy()
        for channel, noise in enumerate(self.noise):
            if not logged.measures[channel] or not noise.has_nuisances:
                continue
            missing = logged.missing[channel]
            known = np.where(np.isfinite(left[channel]), left[channel], 0.0)
            white = noise.white(known[None].copy(), missing)[0]
            rest[channel] -= self._projection(logged, channel).predicted(white)
        return rest

    def _projection(self, logged: Logged, channel: int) -> Projection:
        """How nuisances are projected out of a signal of a trial; made once."""
        key = (id(logged), channel)
        if key not in self._projections:
            free = logged.signals[channel].has_free_zero
            self._projections[key] = projection(self.noise[channel], logged, channel, free)
        return self._projections[key]

    def products(self, columns: Sequence[Array]) -> Pieces:
        """Products of whitened columns, as `columns` gives them."""
        by_trial = [
            self._products(logged, part.astype(np.float64))
            for logged, part in zip(self._trials, columns, strict=True)
        ]
        gathered = self.gathered(by_trial)
        assert gathered is not None
        return gathered

    def gathered(self, by_trial: Sequence[Array]) -> Pieces | None:
        """Products of all trials, put together; None where there are none, or no numbers."""
        if not by_trial or not all(np.isfinite(part).all() for part in by_trial):
            return None
        trial = np.repeat(np.arange(len(by_trial)), [len(part) for part in by_trial])
        counts = np.concatenate([self._counts(logged) for logged in self._trials])
        return Pieces(np.concatenate(by_trial), trial, counts)

    def edges(self, logged: Logged) -> list[int]:
        """Where the pieces of a trial begin, and its end."""
        duration = float(logged.time[-1] - logged.time[0])
        count = max(1, min(round(duration / INDEPENDENT_S), len(logged.time) // 4))
        return [round(k * len(logged.time) / count) for k in range(count + 1)]

    def _products(self, logged: Logged, white: Array) -> Array:
        """Products over the pieces of one trial, shape (pieces, columns, columns)."""
        edges = self.edges(logged)
        products = np.empty((len(edges) - 1, len(white), len(white)))
        for k, (start, stop) in enumerate(zip(edges, edges[1:], strict=False)):
            part = white[:, :, start:stop].reshape(len(white), -1)
            products[k] = part @ part.T
        return products

    def _product(self, logged: Logged, white: Array) -> Array:
        """The sum of `_products`, shape (columns, columns), in fewer and larger steps."""
        total = np.zeros((len(white), len(white)))
        for start in range(0, len(logged.time), ROWS):
            part = white[:, :, start : start + ROWS].reshape(len(white), -1)
            total += part @ part.T
        return total

    def _counts(self, logged: Logged) -> NDArray[np.int64]:
        there = np.zeros(logged.measured.shape, bool)
        for channel in range(len(logged.signals)):
            if logged.measures[channel]:
                there[channel] = True
                there[channel, logged.missing[channel]] = False
        edges = self.edges(logged)
        return np.add.reduceat(there.sum(axis=0), edges[:-1]).astype(np.int64)
