"""The experiment that would tell more: of a library of safe ones, what separates rivals fastest.

Every rival simulates each excitation with its fitted parameters. How far two of them lie apart,
whitened by the noise, is what the data of such a trial could tell; what the parameters of the wrong
one could still absorb, given how well the trials so far determine them, is taken out to first
order. Half of the chi-square that is left is the log-likelihood ratio to expect.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.experiments.excitation import Excitation, library
from pma_gym.discovery.experiments.predicted_trials import (
    as_measured,
    columns,
    derivatives,
    proposal,
)
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect, bounds
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.predictive_density import covariance_root, unabsorbed
from pma_gym.discovery.result.next_experiment import NextExperiment
from pma_gym.discovery.thresholds import RESOLVED, SETTLED
from pma_gym.plant.model import Model

Array = NDArray[np.float64]
Rival = tuple[Fitted, tuple[CandidateEffect, ...]]

DRAWS = 8
"""Sizes and shapes of effects that the promise is tried on, beside the estimate."""

PLAUSIBLE = (0.1, 2.0)
"""Shares of an estimate that draws keep to: what the trials do not bound could be drawn absurd."""


@dataclass(frozen=True)
class ExpectedOdds:
    """What to expect of an excitation.

    Attributes:
        excitation: its name and commands.
        log_odds: of the pair of rivals that is hardest to tell.
        pair: that pair, (true, wrong); (0, 1) where it does not matter.
    """

    excitation: Excitation
    log_odds: float
    pair: tuple[int, int] = (0, 1)

    @property
    def rank(self) -> tuple[bool, float]:
        """What the choice goes by: whether it settles the question, then log odds a minute."""
        return self.log_odds >= SETTLED, self.log_odds / self.excitation.minutes


@dataclass(frozen=True)
class Discrimination:
    """Rivals, and what each may really be.

    Attributes:
        problem: the trials so far.
        fits: of the rivals.
        models: theirs, as a new trial would see them.
        draws: parameters of each, shape (1 + k, p): its estimate, then what it may be as well.
    """

    problem: FitProblem
    fits: tuple[Fitted, ...]
    models: tuple[Model, ...]
    draws: tuple[Array, ...]

    @classmethod
    def of(cls, problem: FitProblem, rivals: Sequence[Rival], seed: int) -> "Discrimination":
        """Of fitted rivals.

        Data that leave a question open seldom tell how large the effect is, and a promise on the
        estimate alone would be broken where that is too large. So the sizes and shapes of effects
        are drawn from what the fit knows of them. The model's own parameters are not: what they
        change is absorbed by the other rival's.
        """
        generator = np.random.Generator(np.random.Philox(seed))
        fits = tuple(fit for fit, _ in rivals)
        models = tuple(_as_next(fit.model, extra) for fit, extra in rivals)
        own = set(problem.own.free)
        return cls(problem, fits, models, tuple(_drawn(fit, own, generator) for fit in fits))

    def pairs(self) -> list[tuple[int, int]]:
        """Which rival may be true, and which is then wrong."""
        return list(permutations(range(len(self.fits)), 2))

    def odds(
        self,
        excitations: Sequence[Excitation],
        pairs: Sequence[tuple[int, int]],
        refitted: bool = True,
    ) -> Array:
        """Log odds to expect of excitations for each pair, shape (excitations, pairs).

        The lower quartile over what the true rival may be: a promise that is mostly kept.

        Args:
            excitations: simulated by the models, in their order.
            pairs: true and wrong rivals.
            refitted: take out what the wrong one's parameters absorb, which costs its derivatives.
        """
        each_odds = np.zeros((len(excitations), len(pairs)))
        changes = {true: self._changes(true, excitations) for true, _ in pairs}
        first = {wrong: true for true, wrong in reversed(pairs) if refitted}
        absorbing = {
            wrong: self._slopes(wrong, _simulated(excitations, true))
            for wrong, true in first.items()
        }
        for at, (true, wrong) in enumerate(pairs):
            fit, trials = self.fits[wrong], _simulated(excitations, true)
            given = columns(self.problem, self.models[wrong], fit.paths, trials, fit.values[None])
            for k, each in enumerate(given):
                if each is None:
                    continue
                apart = each[0].astype(np.float64).ravel() - changes[true][k]
                if refitted:
                    by = absorbing[wrong][k]
                    gains = np.zeros(1) if by is None else unabsorbed(apart, by, fit)
                else:
                    gains = np.sum(apart**2, axis=1)
                each_odds[k, at] = 0.5 * float(np.quantile(gains, 0.25))
        return each_odds

    def _changes(self, true: int, excitations: Sequence[Excitation]) -> list[Array]:
        """What draws of a rival change of its simulations, whitened, shape (1 + k, n) each.

        To first order, which size is nearly: a simulation of every draw may meet parameters so
        odd that it hardly ends.
        """
        fit, draws = self.fits[true], self.draws[true]
        effects = np.flatnonzero(np.any(draws != fit.values, axis=0))
        if not len(effects):
            return [np.zeros((1, 1))] * len(excitations)
        by = self._slopes(true, _simulated(excitations, true), effects)
        moves = (draws - fit.values)[:, effects]
        return [np.zeros((1, 1)) if each is None else moves @ each for each in by]

    def _slopes(
        self, rival: int, trials: Sequence[Trial], which: NDArray[np.int64] | None = None
    ) -> list[Array | None]:
        """Derivatives of trials, if a rival is true, by its parameters, or some of them."""
        return derivatives(self.problem, self.models[rival], self.fits[rival], trials, which)


def _simulated(excitations: Sequence[Excitation], rival: int) -> list[Trial]:
    return [excitation.simulated[rival] for excitation in excitations]


def next_experiment(
    problem: FitProblem, rivals: Sequence[Rival], seed: int
) -> NextExperiment | None:
    """The safe excitation that tells rivals apart fastest.

    Args:
        problem: the trials so far.
        rivals: models that explain them, each fitted, with the candidates in it.
        seed: of what is random in excitations, and of what the rivals may be.
    Returns:
        What to measure next; None where there are not two rivals, see `experiment_to_detect` then,
        or where no excitation is safe.
    """
    if len(rivals) <= 1:
        return None
    discrimination = Discrimination.of(problem, rivals, seed)
    best = fastest(discrimination, list(library([*discrimination.models, problem.given], seed)))
    if best is None:
        return None
    promised = min(best.log_odds, *_after_refit(discrimination, rivals, best))
    shared = set.intersection(*(set(fit.names) for fit in discrimination.fits))
    names = [" + ".join(n for n in fit.names if n not in shared) for fit in discrimination.fits]
    distinguished = [name for name in names if name]
    if len(distinguished) != 1:
        distinguished = [name or "none of them" for name in names]
    return proposal(best.excitation, distinguished, promised)


def fastest(
    discrimination: Discrimination, excitations: Sequence[Excitation]
) -> ExpectedOdds | None:
    """The best of excitations, None if there are none.

    What parameters absorb only lowers the odds. So differences as they are bound them from above,
    and the costly derivatives are needed for few excitations.
    """
    if not excitations:
        return None
    pairs = discrimination.pairs()
    bound = discrimination.odds(excitations, pairs, refitted=False)
    # Two rivals that nothing tells apart must not hide what tells them from a third.
    resolved = np.max(bound, axis=0) >= RESOLVED
    kept = np.flatnonzero(resolved if resolved.any() else ~resolved)
    chosen = [pairs[k] for k in kept]
    hoped = [
        ExpectedOdds(each, float(np.min(row[kept])))
        for each, row in zip(excitations, bound, strict=True)
    ]
    best: ExpectedOdds | None = None
    for expected in sorted(hoped, key=lambda each: each.rank, reverse=True):
        if best is not None and expected.rank <= best.rank:
            break
        (odds,) = discrimination.odds([expected.excitation], chosen)
        fastest_pair = ExpectedOdds(
            expected.excitation, float(np.min(odds)), chosen[int(np.argmin(odds))]
        )
        if best is None or fastest_pair.rank > best.rank:
            best = fastest_pair
    return best


def _after_refit(
    discrimination: Discrimination, rivals: Sequence[Rival], expected: ExpectedOdds
) -> Iterator[float]:
    """Log odds of the hardest pair, either way round, when the wrong one is really refitted.

    Where trials hardly determine a rival, first order underestimates what it can absorb.
    """
    problem = discrimination.problem
    for true, wrong in (expected.pair, expected.pair[::-1]):
        fit, extra = rivals[wrong]
        trial = as_measured(problem, expected.excitation.simulated[true])
        joint = replace(problem, trials=[*problem.trials, trial])
        refitted = joint.fit(fit.model, [_once_more(candidate) for candidate in extra])
        if refitted is not None:
            yield max(0.0, 0.5 * (refitted.chi_square - fit.chi_square))


def _once_more(candidate: CandidateEffect) -> CandidateEffect:
    """A candidate with one trial more, the first after a rest."""
    return replace(
        candidate, own={path: [*each, min(each)] for path, each in candidate.own.items()}
    )


def _drawn(fit: Fitted, own: set[str], generator: np.random.Generator) -> Array:
    """The estimate, then draws of a fit's effects, within bounds, shape (1 + DRAWS, p)."""
    free = np.array([path not in own for path in fit.paths])
    moves = (covariance_root(fit) @ generator.standard_normal((len(fit.paths), DRAWS))).T
    scale = np.where(fit.values == 0.0, 1.0, fit.values)
    drawn = fit.values * np.where(free, np.clip(1.0 + moves / scale, *PLAUSIBLE), 1.0)
    return np.concatenate([fit.values[None], np.clip(drawn, *bounds(fit.paths))])


def _as_next(model: Model, extra: Sequence[CandidateEffect]) -> Model:
    """A model as a new trial would see it, the first after a rest."""
    own = {path: float(min(each)) for candidate in extra for path, each in candidate.own.items()}
    return model.replace(own) if own else model
