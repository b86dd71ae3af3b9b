"""Fits of a model, alone or with suspects in it, to whitened trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.candidate_effect import Suspect
from pma_gym.discovery.fitting.free_parameters import Own, values
from pma_gym.discovery.preparation.assumed_range import LEAST_GAIN, MOST_DOUBLINGS
from pma_gym.discovery.preparation.noise import Whitening
from pma_gym.discovery.preparation.whitened_residuals import Evidence
from pma_gym.estimation.fitting import Search
from pma_gym.estimation.least_squares import inverse
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

ROUNDS = 25
"""Most rounds of one fit."""

LARGER = (30.0, 5.0)
"""How many times as large the noise is taken for on the way to a first fit."""

CAUGHT, EASIER = 3.0, 10.0
"""Residual, in standard deviations of the noise, from which on a fit may have been caught; how many
times smaller the noise is taken for from one fit to the next on the way out."""

RUGGED, STIFFER, SUSPECT = "cable.stiffness_n_per_mm", (0.75, 0.9, 1.1, 1.3), 1.3
"""What chi-square is rugged in, at which shares of the given value fits begin from it, and the
chi-square a reading from which on they do."""


@dataclass(frozen=True)
class Fitted:
    """A model fitted to trials.

    Attributes:
        model: the model with its parameters.
        names: the suspects in it.
        paths: its free parameters.
        values: their values at the door, shape (p,).
        covariance: theirs, from the whitened readings and the prior, shape (p, p).
        chi_square: of the whitened readings, with what the prior adds.
        steps: moves of the parameters that their derivatives were taken with.
        converged: whether a further step would gain nothing worth while.
        reach: how many times as wide as assumed beforehand the range of a parameter became, by
            path, for those that went beyond.
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

    def estimate(self, path: str) -> tuple[float, float]:
        """A parameter's value and its standard error, at the door."""
        at = self.paths.index(path)
        return float(self.values[at]), float(np.sqrt(self.covariance[at, at]))


def _chi_square(fit: Fitted) -> float:
    return fit.chi_square


@dataclass(frozen=True)
class Bench:
    """What all fits share.

    Attributes:
        trials: the trials.
        given: the model as it was given.
        own: its own parameters and what they may be off by.
        noise: whitening of each output.
        threads: how many threads simulate.
        coarse: whether a sensor keeps to coarser steps than its DAQ gives.
        files: the file that each trial comes from; empty where each is a file of its own.
    """

    trials: Sequence[Trial]
    given: Model
    own: Own
    noise: tuple[Whitening, ...]
    threads: int = 1
    coarse: bool = False
    files: tuple[str, ...] = ()

    def evidence(
        self,
        model: Model,
        extra: Sequence[Suspect] = (),
        trials: Sequence[int] | None = None,
        reach: Mapping[str, float] | None = None,
    ) -> Evidence:
        """Trials beside a model with suspects in it; its own parameters and theirs are free.

        Args:
            model: the model.
            extra: the suspects.
            trials: which trials; all if not given.
            reach: how many times as wide as assumed beforehand ranges are, by path.
        """
        paths, own = list(self.own.free), {}
        for suspect in extra:
            paths += suspect.fitted_paths
            own |= suspect.own
        prior = np.full(len(paths), np.inf)
        prior[: len(self.own.prior)] = self.own.prior
        chosen = range(len(self.trials)) if trials is None else trials
        centre = values(model, paths)
        centre[: len(self.own.free)] = values(self.given, self.own.free)
        return Evidence(
            model,
            [self.trials[i] for i in chosen],
            paths,
            self.noise,
            prior,
            centre,
            {path: [each[i] for i in chosen] for path, each in own.items()},
            threads=self.threads,
            reach=reach,
        )

    def probed(self, model: Model, suspect: Suspect) -> Evidence:
        """Trials beside a model with one suspect in it, all of whose parameters are free."""
        return Evidence(
            suspect.beside(model),
            self.trials,
            suspect.paths,
            self.noise,
            np.full(len(suspect.paths), np.inf),
            own=suspect.own,
            threads=self.threads,
        )

    @cached_property
    def count(self) -> int:
        """How many readings there are."""
        return self.evidence(self.given).count

    def sum_of_squares(self, model: Model, extra: Sequence[Suspect] = ()) -> float:
        """Whitened sum of squares of all readings, without what the prior adds.

        Infinite where the model cannot be simulated.
        """
        evidence = self.evidence(model, extra)
        at = values(model, [free.path for free in evidence.free])
        pieces = evidence.pieces(at, np.empty(0))
        return np.inf if pieces is None else float(pieces.total()[0, 0])

    def left(self, fit: Fitted) -> float:
        """Rms of what a fit leaves, the prior counted, in standard deviations of the noise."""
        return float(np.sqrt(fit.chi_square / self.count))

    def far(self, fit: Fitted) -> bool:
        """Whether a fit is so far from the trials that it may have been caught."""
        return self.left(fit) > CAUGHT

    def careful_fit(self, model: Model, extra: Sequence[Suspect] = ()) -> Fitted | None:
        """Fit a model with suspects in it, whose parameters may be far off.

        A cable that slackens makes chi-square rugged, and a search that begins far away can end in
        a hollow. With the noise taken for larger, what parameters may be holds them on their way.
        The rotor rings on the cable, at a frequency that a search finds from nearby only: where
        much is left, fits begin from other stiffnesses too. The best of all is returned.
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

    def led_out(self, fit: Fitted, extra: Sequence[Suspect] = ()) -> Fitted:
        """A fit, or a better one where it was caught far from the trials.

        With the noise taken for as large as what is left, and then for ever less, slopes are those
        of long moves, which lead out of a hollow.
        """
        if not self.far(fit):
            return fit
        left = self.left(fit)
        ever_less = [left / EASIER**k for k in range(int(np.log(left) / np.log(EASIER)) + 1)]
        found = self.fit(self._eased(fit.model, extra, ever_less), extra)
        return min(filter(None, (fit, found)), key=_chi_square)

    def _eased(self, model: Model, extra: Sequence[Suspect], larger: Sequence[float]) -> Model:
        """A model fitted to larger noise, ever less of it."""
        for factor in larger:
            noise = tuple(
                Whitening(n.coefficients, factor * n.innovation, factor * n.level)
                for n in self.noise
            )
            found = replace(self, noise=noise).fit(model, extra)
            model = model if found is None else found.model
        return model

    def evidence_of(self, fit: Fitted, extra: Sequence[Suspect] = ()) -> Evidence:
        """Trials beside a fit with suspects in it, within the ranges that it ended with."""
        return self.evidence(fit.model, extra, reach=fit.reach)

    def fit(
        self,
        model: Model,
        extra: Sequence[Suspect] = (),
        starts: Mapping[str, Array] | None = None,
        trials: Sequence[int] | None = None,
    ) -> Fitted | None:
        """Fit a model with suspects in it.

        A parameter goes beyond what is assumed beforehand where the fit gains by it
        (`assumed_range`).

        Args:
            model: where its own parameters begin.
            extra: the suspects.
            starts: values of all their `paths`, by name; where they are in the model if not given.
            trials: which trials; all if not given.
        Returns:
            The fit, or None where the model cannot be simulated.
        """
        for suspect in extra:
            model = suspect.beside(model)
            if starts is not None and suspect.name in starts:
                begun = dict(zip(suspect.paths, map(float, starts[suspect.name]), strict=True))
                model = model.replace(begun)
        evidence = self.evidence(model, extra, trials)
        # A fit of some of the trials begins where that of all ended.
        reach = evidence.needed_reach(evidence.start)
        evidence = self.evidence(model, extra, trials, reach) if reach else evidence
        try:
            search = Search(evidence, False, 1.0)
        except ValueError:
            return None
        converged = search.run(None, ROUNDS)
        for _ in range(MOST_DOUBLINGS):
            edges = evidence.at_assumed_edge(search.values)
            if not edges:
                break
            wider = reach | {path: 2.0 * reach.get(path, 1.0) for path in edges}
            evidence = self.evidence(_at(model, search), extra, trials, wider)
            further = Search(evidence, False, 1.0)
            ended = further.run(None, ROUNDS)
            if not further.best.chi_square < search.best.chi_square - LEAST_GAIN:
                break
            search, converged, reach = further, ended, wider
        return Fitted(
            _at(model, search),
            tuple(suspect.name for suspect in extra),
            tuple(search.named(search.values)),
            search.values,
            inverse(search.best.curvature),
            search.best.chi_square,
            search.moves,
            converged,
            evidence.needed_reach(search.values),
        )


def _at(model: Model, search: Search) -> Model:
    """A model with the parameters that a search is at."""
    return model.replace(search.named(search.values))
