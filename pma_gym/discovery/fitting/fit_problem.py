"""Fit a model, with or without candidate effects, to whitened trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect, within_turn
from pma_gym.discovery.fitting.free_parameters import FreeParameters, values
from pma_gym.discovery.fitting.levenberg_marquardt import LevenbergMarquardt
from pma_gym.discovery.preparation.noise import Whitening
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.thresholds import CONFIDENCE, FLAT, MOST_DOUBLINGS, STRUCTURE
from pma_gym.estimation.least_squares import inverse
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

ROUNDS = 25
"""Most rounds of one fit."""

LARGER = (30.0, 5.0)
"""How many times as large the noise is taken for on the way to a first fit."""

EASIER = 10.0
"""How many times smaller the noise is taken for from one fit to the next on the way out of a local
minimum."""

ROUNDING = 1e-3
"""The trials do not show a parameter whose whole range is a smaller share of its standard error."""

RUGGED, STIFFER, SUSPECT = "cable.stiffness_n_per_mm", (0.75, 0.9, 1.1, 1.3), 1.3
"""What chi-square is rugged in, at which shares of the given value fits begin from it, and the
chi-square a reading from which on they do."""


@dataclass(frozen=True)
class Fitted:
    """A model fitted to trials.

    Attributes:
        model: the model with its parameters.
        names: the candidates in it.
        paths: its free parameters.
        values: their values in file units, shape (p,).
        covariance: theirs, from the whitened readings and the prior, shape (p, p).
        chi_square: of the whitened readings, with what the prior adds.
        steps: moves of the parameters that their derivatives were taken with.
        converged: whether a further step would gain nothing worth while.
        reach: how many times as wide as assumed beforehand the range of a parameter became, by
            path, for those that went beyond.
        spread: ends of the intervals at all optima that explain the trials about as well, by
            path; empty where one optimum is known.
    """

    model: Model
    names: tuple[str, ...]
    paths: tuple[str, ...]
    values: Array
    covariance: Array
    chi_square: float
    steps: Array
    converged: bool
    reach: Mapping[str, float] = field(default_factory=dict)
    spread: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def estimate(self, path: str) -> tuple[float, float]:
        """A parameter's value and its standard error, in file units."""
        at = self.paths.index(path)
        return float(self.values[at]), float(np.sqrt(self.covariance[at, at]))

    def interval(self, path: str, error: float | None = None) -> tuple[float, float]:
        """Least and greatest value (95 %) of a parameter, in file units; equal optima count.

        Args:
            path: the parameter.
            error: its standard error; the fit's own if not given. Where it is not finite,
                neither end is.
        """
        value, own = self.estimate(path)
        error = own if error is None else error
        if not np.isfinite(error):
            return -np.inf, np.inf
        low, high = self.spread.get(path, (value, value))
        return min(value - CONFIDENCE * error, low), max(value + CONFIDENCE * error, high)


def _chi_square(fit: Fitted) -> float:
    return fit.chi_square


@dataclass(frozen=True)
class FitProblem:
    """What all fits share.

    Attributes:
        trials: the trials.
        given: the model as it was given.
        own: its own parameters and what they may be off by.
        noise: whitening of each output.
        threads: how many threads simulate.
        coarse: whether a sensor keeps to coarser steps than its DAQ gives.
        files: the file that each trial comes from; empty where each is a file of its own.
        widens: whether a parameter may go beyond what is assumed of it beforehand.
    """

    trials: Sequence[Trial]
    given: Model
    own: FreeParameters
    noise: tuple[Whitening, ...]
    threads: int = 1
    coarse: bool = False
    files: tuple[str, ...] = ()
    widens: bool = True

    def whitened_residuals(
        self,
        model: Model,
        extra: Sequence[CandidateEffect] = (),
        trials: Sequence[int] | None = None,
        reach: Mapping[str, float] | None = None,
    ) -> WhitenedResiduals:
        """Trials beside a model with candidates in it; its own parameters and theirs are free.

        Args:
            model: the model.
            extra: the candidates.
            trials: which trials; all if not given.
            reach: how many times as wide as assumed beforehand ranges are, by path.
        """
        paths, own, lowest, highest = list(self.own.free), {}, {}, {}
        for candidate in extra:
            paths += candidate.fitted_paths
            own |= candidate.own
            lowest |= candidate.lowest
            highest |= candidate.highest
        prior = np.full(len(paths), np.inf)
        prior[: len(self.own.prior)] = self.own.prior
        chosen = range(len(self.trials)) if trials is None else trials
        centre = values(model, paths)
        centre[: len(self.own.free)] = values(self.given, self.own.free)
        return WhitenedResiduals(
            model,
            [self.trials[i] for i in chosen],
            paths,
            self.noise,
            prior,
            centre,
            {path: [each[i] for i in chosen] for path, each in own.items()},
            threads=self.threads,
            reach=reach,
            lowest=lowest,
            highest=highest,
        )

    def probed(self, model: Model, candidate: CandidateEffect) -> WhitenedResiduals:
        """Trials beside a model with one candidate in it, all of whose parameters are free."""
        return WhitenedResiduals(
            candidate.beside(model),
            self.trials,
            candidate.paths,
            self.noise,
            np.full(len(candidate.paths), np.inf),
            own=candidate.own,
            threads=self.threads,
        )

    @property
    def runs(self) -> list[int]:
        """Of each trial, the number of the file that it comes from."""
        numbers: dict[str, int] = {}
        return [numbers.setdefault(file, len(numbers)) for file in self.files]

    @cached_property
    def count(self) -> int:
        """How many readings there are."""
        return self.whitened_residuals(self.given).count

    def sum_of_squares(self, model: Model, extra: Sequence[CandidateEffect] = ()) -> float:
        """Whitened sum of squares of all readings, without what the prior adds.

        Infinite where the model cannot be simulated.
        """
        whitened = self.whitened_residuals(model, extra)
        at = values(model, [free.path for free in whitened.free])
        pieces = whitened.pieces(at, np.empty(0))
        return np.inf if pieces is None else float(pieces.total()[0, 0])

    def steps_a_row(self, model: Model, extra: Sequence[CandidateEffect] = ()) -> float:
        """Steps of the integrator from one row to the next, in the mean over the trials."""
        whitened = self.whitened_residuals(model, extra)
        whitened.pieces(values(model, [free.path for free in whitened.free]), np.empty(0))
        return whitened.attempts / sum(len(trial.time) for trial in self.trials)

    def left(self, fit: Fitted) -> float:
        """Rms of what a fit leaves, the prior counted, in standard deviations of the noise."""
        return float(np.sqrt(fit.chi_square / self.count))

    def far(self, fit: Fitted) -> bool:
        """Whether a fit is so far from the trials that it may be in a local minimum."""
        return self.left(fit) > STRUCTURE

    def astray(self, fit: Fitted) -> bool:
        """Whether own parameters make up for structure: beyond what is assumed, and yet far."""
        return self.far(fit) and any(path in self.own.free for path in fit.reach)

    def fit_as_assumed(self, fit: Fitted, extra: Sequence[CandidateEffect] = ()) -> Fitted | None:
        """A fit from the given parameters, within what is assumed of them, in place of another.

        Args:
            fit: the other, whose effects stay as they are to begin with.
            extra: the candidates in it.
        """
        own = dict(zip(self.own.free, values(self.given, self.own.free).tolist(), strict=True))
        return replace(self, widens=False).fit(fit.model.replace(own), extra)

    def careful_fit(self, model: Model, extra: Sequence[CandidateEffect] = ()) -> Fitted | None:
        """Fit a model with candidates in it, whose parameters may be far off.

        A cable that slackens makes chi-square rugged, and a search that starts far away can end in
        a local minimum. With the noise assumed larger, the prior keeps parameters from going
        astray. The rotor oscillates on the cable, at a frequency that a search finds from nearby
        only: where much is left, fits start from other stiffnesses too. The best is returned.
        """
        begun = self._eased(model, extra, LARGER)
        fits = [self.fit(begun, extra), self.fit(model, extra)]
        best = min(filter(None, fits), key=_chi_square, default=None)
        if best is None:
            return None
        if RUGGED in self.own.free and self.left(best) ** 2 > SUSPECT:
            given = values(self.given, [RUGGED])[0]
            for factor in STIFFER:
                away = best.model.replace({RUGGED: float(factor * given)})
                fits.append(self.fit(self._eased(away, extra, LARGER[-1:]), extra))
        return min(filter(None, fits), key=_chi_square)

    def continuation(self, fit: Fitted, extra: Sequence[CandidateEffect] = ()) -> Fitted:
        """A fit, or a better one where it was in a local minimum far from the trials.

        The noise is assumed as large as the residual, then ever smaller: a continuation, whose
        derivatives are those of long steps, which leave a local minimum.
        """
        if not self.far(fit):
            return fit
        left = self.left(fit)
        ever_less = [left / EASIER**k for k in range(int(np.log(left) / np.log(EASIER)) + 1)]
        refit = self.fit(self._eased(fit.model, extra, ever_less), extra)
        return min(filter(None, (fit, refit)), key=_chi_square)

    def until_converged(self, fit: Fitted, extra: Sequence[CandidateEffect] = ()) -> Fitted:
        """A fit, gone on with from where it ended until it converges or gains no more.

        In a direction in which chi-square is rugged a search spends its rounds on ever smaller
        steps of all parameters. One that begins where it ended takes whole ones again.
        """
        while not fit.converged:
            further = self.fit(fit.model, extra)
            if further is None or fit.chi_square - further.chi_square < FLAT:
                break
            fit = further
        return fit

    def _eased(
        self, model: Model, extra: Sequence[CandidateEffect], larger: Sequence[float]
    ) -> Model:
        """A model fitted to larger noise, ever less of it."""
        for factor in larger:
            noise = tuple(
                replace(n, innovation=factor * n.innovation, level=factor * n.level)
                for n in self.noise
            )
            fitted = replace(self, noise=noise).fit(model, extra)
            model = model if fitted is None else fitted.model
        return model

    def whitened_at(self, fit: Fitted, extra: Sequence[CandidateEffect] = ()) -> WhitenedResiduals:
        """Trials beside a fit with candidates in it, within the ranges that it ended with."""
        return self.whitened_residuals(fit.model, extra, reach=fit.reach)

    def fit(
        self,
        model: Model,
        extra: Sequence[CandidateEffect] = (),
        starts: Mapping[str, Array] | None = None,
        trials: Sequence[int] | None = None,
    ) -> Fitted | None:
        """Fit a model with candidates in it.

        A parameter goes beyond what is assumed beforehand where the fit gains by it
        (`assumed_range`).

        Args:
            model: where its own parameters begin.
            extra: the candidates.
            starts: values of all their `paths`, by name; where they are in the model if not given.
            trials: which trials; all if not given.
        Returns:
            The fit, or None where the model cannot be simulated.
        """
        for candidate in extra:
            model = candidate.beside(model)
            if starts is not None and candidate.name in starts:
                begun = dict(zip(candidate.paths, map(float, starts[candidate.name]), strict=True))
                model = model.replace(begun)
        whitened = self.whitened_residuals(model, extra, trials)
        # A fit of some of the trials begins where that of all ended.
        reach = whitened.needed_reach(whitened.start)
        if reach:
            whitened = self.whitened_residuals(model, extra, trials, reach)
        try:
            search = LevenbergMarquardt(whitened)
        except ValueError:
            return None
        converged = search.run(ROUNDS)
        for _ in range(MOST_DOUBLINGS if self.widens else 0):
            edges = whitened.at_assumed_edge(search.values)
            if not edges:
                break
            wider = reach | {path: 2.0 * reach.get(path, 1.0) for path in edges}
            whitened = self.whitened_residuals(_at(model, search), extra, trials, wider)
            try:
                further = LevenbergMarquardt(whitened)
            except ValueError:
                # At the end of what it balances: a rounded number may lie beyond.
                break
            ended = further.run(ROUNDS)
            if not further.best.chi_square < search.best.chi_square - FLAT:
                break
            search, converged, reach = further, ended, wider
        paths = tuple(search.named(search.values))
        ended_at = within_turn(paths, search.values)
        return Fitted(
            model.replace(dict(zip(paths, ended_at.tolist(), strict=True))),
            tuple(candidate.name for candidate in extra),
            paths,
            ended_at,
            inverse(_shown(search.best.curvature, whitened.upper - whitened.lower)),
            search.best.chi_square,
            search.moves,
            converged,
            whitened.needed_reach(search.values),
        )


def _shown(curvature: Array, widths: Array) -> Array:
    """A curvature without the parameters that the trials do not show: theirs is rounding.

    Args:
        curvature: half the second derivatives of chi-square, shape (p, p).
        widths: of the parameters' ranges, shape (p,).
    """
    own = np.diag(curvature)
    shown = np.where(own > 0.0, own * widths**2, 0.0) > ROUNDING**2
    return np.where(np.outer(shown, shown), curvature, 0.0)


def _at(model: Model, search: LevenbergMarquardt) -> Model:
    """A model with the parameters that a search is at."""
    return model.replace(search.named(search.values))
