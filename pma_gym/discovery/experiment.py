"""The experiment that would tell more: of a library of safe ones, what separates rivals fastest.

Every rival simulates each protocol with the parameters that it was fitted with. How far two of them
lie apart, whitened by the noise, is what the data of such a trial could tell; what the parameters
of the wrong one could still absorb, given how well the trials so far determine them, is taken out
to first order. Half of the chi-square that is left is the log-likelihood ratio to expect.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.diagnosis import NextExperiment
from pma_gym.discovery.evidence import Evidence
from pma_gym.discovery.fits import Bench, Fitted
from pma_gym.discovery.protocols import Protocol, library
from pma_gym.discovery.screening import SHOWN_GAIN, Look
from pma_gym.discovery.suspects import Suspect, bounds
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

Array = NDArray[np.float64]
Rival = tuple[Fitted, tuple[Suspect, ...]]

ENOUGH = SHOWN_GAIN / 2.0
"""Log odds that settle a question: five standard deviations. A shorter test that would leave it
open is not preferred to one that settles it."""

LEAST = 1.0
"""Log odds below which no protocol tells two rivals apart at all."""

MOST = 50.0
"""Largest log odds that are promised: no model is that exact."""

DRAWS = 8
"""Sizes and shapes of effects that the promise is tried on, beside the estimate."""

PLAUSIBLE = (0.1, 2.0)
"""Shares of an estimate that draws keep to: what the trials do not bound could be drawn absurd."""

SMALLEST = 0.1
"""Least size of an effect that is reckoned with, as a share of its usual one."""

LOOSE = 1e4
"""Standard deviation of a parameter that the trials do not determine, in steps of its
derivative."""


@dataclass(frozen=True)
class Hope:
    """What to expect of a protocol.

    Attributes:
        protocol: the protocol.
        log_odds: of the pair of rivals that is hardest to tell.
        pair: that pair, (true, wrong); (0, 1) where it does not matter.
    """

    protocol: Protocol
    log_odds: float
    pair: tuple[int, int] = (0, 1)

    @property
    def rank(self) -> tuple[bool, float]:
        """What the choice goes by: whether it settles the question, then log odds a minute."""
        return self.log_odds >= ENOUGH, self.log_odds / self.protocol.minutes


@dataclass(frozen=True)
class Contest:
    """Rivals, and what each may really be.

    Attributes:
        bench: the trials so far.
        fits: of the rivals.
        models: theirs, as a new trial would see them.
        draws: parameters of each, shape (1 + k, p): its estimate, then what it may be as well.
    """

    bench: Bench
    fits: tuple[Fitted, ...]
    models: tuple[Model, ...]
    draws: tuple[Array, ...]

    @classmethod
    def of(cls, bench: Bench, rivals: Sequence[Rival], seed: int) -> "Contest":
        """Of fitted rivals.

        Data that leave a question open seldom tell how large the effect is, and a promise on the
        estimate alone would be broken where that is too large. So the sizes and shapes of effects
        are drawn from what the fit knows of them. The model's own parameters are not: what they
        change is absorbed by the other rival's.
        """
        generator = np.random.Generator(np.random.Philox(seed))
        fits = tuple(fit for fit, _ in rivals)
        models = tuple(_as_next(fit.model, extra) for fit, extra in rivals)
        own = set(bench.own.free)
        return cls(bench, fits, models, tuple(_drawn(fit, own, generator) for fit in fits))

    def pairs(self) -> list[tuple[int, int]]:
        """Which rival may be true, and which is then wrong."""
        return list(permutations(range(len(self.fits)), 2))

    def odds(
        self, protocol: Protocol, pairs: Sequence[tuple[int, int]], refitted: bool = True
    ) -> Array:
        """Log odds to expect of a protocol for each pair, shape (pairs,).

        The lower quartile over what the true rival may be: a promise that is mostly kept.

        Args:
            protocol: simulated by the models, in their order.
            pairs: true and wrong rivals.
            refitted: take out what the wrong one's parameters absorb, which costs its derivatives.
        """
        found = np.zeros(len(pairs))
        changes: dict[int, Array] = {}
        derivatives: dict[int, Array | None] = {}
        for k, (true, wrong) in enumerate(pairs):
            fit, simulated = self.fits[wrong], protocol.simulated[true]
            evidence = _evidence(self.bench, self.models[wrong], fit.paths, simulated)
            columns = evidence.columns(fit.values[None])
            if columns is None:
                continue
            if true not in changes:
                changes[true] = self._changes(true, simulated)
            apart = columns[0][0].astype(np.float64).ravel() - changes[true]
            if refitted:
                if wrong not in derivatives:
                    derivatives[wrong] = _derivatives(evidence, fit)
                by = derivatives[wrong]
                gains = np.zeros(1) if by is None else left_over(apart, by, fit)
            else:
                gains = np.sum(apart**2, axis=1)
            found[k] = 0.5 * float(np.quantile(gains, 0.25))
        return found

    def _changes(self, true: int, simulated: Trial) -> Array:
        """What draws of a rival change of its simulation, whitened, shape (1 + k, n).

        To first order, which size is nearly: a simulation of every draw may meet parameters so
        odd that it hardly ends.
        """
        fit, draws = self.fits[true], self.draws[true]
        effects = np.flatnonzero(np.any(draws != fit.values, axis=0))
        evidence = _evidence(self.bench, self.models[true], fit.paths, simulated)
        by = _derivatives(evidence, fit, effects) if len(effects) else None
        if by is None:
            return np.zeros((1, 4 * len(simulated)))
        return (draws - fit.values)[:, effects] @ by


def next_experiment(bench: Bench, rivals: Sequence[Rival], seed: int) -> NextExperiment | None:
    """The safe protocol that tells rivals apart fastest.

    Args:
        bench: the trials so far.
        rivals: models that explain them, each fitted, with the suspects in it.
        seed: of what is random in protocols, and of what the rivals may be.
    Returns:
        What to measure next; None where there are not two rivals, see `for_blind` then, or where
        no protocol is safe.
    """
    if len(rivals) < 2:
        return None
    contest = Contest.of(bench, rivals, seed)
    best = fastest(contest, list(library([*contest.models, bench.given], seed)))
    if best is None:
        return None
    promised = min(best.log_odds, *_after_refit(contest, rivals, best))
    shared = set.intersection(*(set(fit.names) for fit in contest.fits))
    names = [" + ".join(n for n in fit.names if n not in shared) for fit in contest.fits]
    return _proposal(best.protocol, [name or "none of them" for name in names], promised)


def fastest(contest: Contest, protocols: Sequence[Protocol]) -> Hope | None:
    """The best of protocols, None if there are none.

    What parameters absorb only lowers the odds. So differences as they are bound them from above,
    and the costly derivatives are needed for few protocols.
    """
    if not protocols:
        return None
    pairs = contest.pairs()
    bound = np.array([contest.odds(each, pairs, refitted=False) for each in protocols])
    # Two rivals that nothing tells apart must not hide what tells them from a third.
    told = np.max(bound, axis=0) >= LEAST
    kept = np.flatnonzero(told if told.any() else ~told)
    chosen = [pairs[k] for k in kept]
    hoped = [
        Hope(each, float(np.min(row[kept]))) for each, row in zip(protocols, bound, strict=True)
    ]
    best: Hope | None = None
    for hope in sorted(hoped, key=lambda each: each.rank, reverse=True):
        if best is not None and hope.rank <= best.rank:
            break
        odds = contest.odds(hope.protocol, chosen)
        found = Hope(hope.protocol, float(np.min(odds)), chosen[int(np.argmin(odds))])
        if best is None or found.rank > best.rank:
            best = found
    return best


def _after_refit(contest: Contest, rivals: Sequence[Rival], hope: Hope) -> Iterator[float]:
    """Log odds of the hardest pair, either way round, when the wrong one is really refitted.

    Where trials hardly determine a rival, first order underestimates what it can absorb.
    """
    bench = contest.bench
    for true, wrong in (hope.pair, hope.pair[::-1]):
        fit, extra = rivals[wrong]
        trial = _as_measured(bench, hope.protocol.simulated[true])
        joint = replace(bench, trials=[*bench.trials, trial])
        refitted = joint.fit(fit.model, [_once_more(suspect) for suspect in extra])
        if refitted is not None:
            yield max(0.0, 0.5 * (refitted.chi_square - fit.chi_square))


def _once_more(suspect: Suspect) -> Suspect:
    """A suspect with one trial more, the first after a rest."""
    return replace(suspect, own={path: [*each, min(each)] for path, each in suspect.own.items()})


def _drawn(fit: Fitted, own: set[str], generator: np.random.Generator) -> Array:
    """The estimate, then draws of a fit's effects, within bounds, shape (1 + DRAWS, p)."""
    free = np.array([path not in own for path in fit.paths])
    moves = (_root(fit) @ generator.standard_normal((len(fit.paths), DRAWS))).T
    scale = np.where(fit.values == 0.0, 1.0, fit.values)
    drawn = fit.values * np.where(free, np.clip(1.0 + moves / scale, *PLAUSIBLE), 1.0)
    return np.concatenate([fit.values[None], np.clip(drawn, *bounds(fit.paths))])


def for_blind(
    bench: Bench, fit: Fitted, suspects: Sequence[Suspect], looks: Sequence[Look], seed: int = 0
) -> NextExperiment | None:
    """The protocol in which most would show of what these trials cannot show.

    How large an effect is if it is there nobody knows: any size from a tenth of the usual one to
    that counts as equally likely, in proportion. The best protocol makes the most effects show that
    would not have shown by now, on average; among equals the shortest.

    Args:
        bench: the trials so far.
        fit: the refitted model, without any suspect that is looked for.
        suspects: those that would be worth seeing.
        looks: at them in the trials so far, which say from what size on they would have been seen.
        seed: of what is random in protocols.
    Returns:
        What to measure next; None where every effect would have been seen at its usual size, or no
        protocol would show one that would not.
    """
    known = {each.suspect.name: each for each in looks}
    wanted = [suspect for suspect in suspects if suspect.name in known]
    hidden = np.array([not _was_visible(known[suspect.name]) for suspect in wanted], bool)
    if not hidden.any():
        return None
    before = np.array([_strength(known[suspect.name]) for suspect in wanted])
    pairs = [(suspect, _usual(suspect)) for suspect in wanted]
    best: tuple[tuple[float, float], Protocol, Array] | None = None
    for protocol in library([fit.model, bench.given], seed):
        gains = _shown(bench, fit, protocol, pairs)
        new = float(np.sum(chance_to_show(before + gains) - chance_to_show(before)))
        rank = round(new, 6), -protocol.minutes
        if (hidden & (gains >= SHOWN_GAIN)).any() and (best is None or rank > best[0]):
            best = rank, protocol, gains
    if best is None:
        return None
    seen = hidden & (best[2] >= SHOWN_GAIN)
    names = [suspect.name for suspect, shows in zip(wanted, seen, strict=True) if shows]
    return _proposal(best[1], names, 0.5 * float(np.min(best[2][seen])))


def chance_to_show(gains: Array) -> Array:
    """Chance that effects show which are as large as usual, or down to a tenth of that.

    Args:
        gains: chi-square that each gains at its usual size, shape (k,); it goes with the square of
            the size.
    """
    share = np.sqrt(SHOWN_GAIN / np.maximum(gains, 1e-12))
    return np.clip(np.log(share) / np.log(SMALLEST), 0.0, 1.0)


def _strength(each: Look) -> float:
    """Chi-square that an effect of usual size would have gained in the trials so far."""
    return SHOWN_GAIN / each.resolvable**2 if each.resolvable else 0.0


def _was_visible(each: Look) -> bool:
    return each.resolvable is not None and each.resolvable <= 1.0


def left_over(differences: Array, derivatives: Array, fit: Fitted) -> Array:
    """Chi-square of differences that free parameters cannot absorb, given what is known of them.

    The minimum over moves m of |d + J m|^2 + m C^-1 m, with the covariance C of the fit.

    Args:
        differences: d, whitened, shape (k, n).
        derivatives: J, whitened, by the fit's parameters, shape (p, n).
        fit: says how well its parameters are known.
    Returns:
        Shape (k,).
    """
    moves = _root(fit).T @ derivatives
    inner = moves @ moves.T + np.eye(len(moves))
    along = differences @ moves.T
    absorbed = np.sum(along * np.linalg.solve(inner, along.T).T, axis=1)
    return np.maximum(np.sum(differences**2, axis=1) - absorbed, 0.0)


def _root(fit: Fitted) -> Array:
    """R with R R^T the covariance of a fit, shape (p, p)."""
    covariance = fit.covariance.copy()
    unknown = np.flatnonzero(~np.isfinite(np.diag(covariance)))
    covariance[unknown, unknown] = (LOOSE * fit.steps[unknown]) ** 2
    scale = np.sqrt(np.diag(covariance))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def _derivatives(
    evidence: Evidence, fit: Fitted, which: Sequence[int] | NDArray[np.int64] | None = None
) -> Array | None:
    """Derivatives of one trial's whitened readings, shape (p, 4 rows); None if it has none.

    Args:
        evidence: the trial.
        fit: where, and how far parameters are moved for it.
        which: by which parameters; all if not given.
    """
    chosen = np.arange(len(fit.values)) if which is None else np.asarray(which)
    moved = fit.values + np.diag(fit.steps)[chosen]
    columns = evidence.columns(np.concatenate([fit.values[None], moved]))
    if columns is None:
        return None
    changes = columns[0][1:].astype(np.float64)
    return changes.reshape(len(chosen), -1) / fit.steps[chosen, None]


def _shown(
    bench: Bench,
    fit: Fitted,
    protocol: Protocol,
    hidden: Sequence[tuple[Suspect, Array]],
) -> Array:
    """Chi-square that hidden suspects of usual size would gain in a protocol, shape (k,)."""
    simulated = protocol.simulated[0]
    by = _derivatives(_evidence(bench, fit.model, fit.paths, simulated), fit)
    if by is None:
        return np.zeros(len(hidden))
    changes = np.zeros((len(hidden), by.shape[1]))
    for row, (suspect, usual) in zip(changes, hidden, strict=True):
        evidence = _evidence(bench, suspect.beside(fit.model), suspect.paths, simulated)
        columns = evidence.columns(np.stack([suspect.absent, usual]))
        if columns is not None:
            row[:] = columns[0][1].ravel()
    return left_over(changes, by, fit)


def _usual(suspect: Suspect) -> Array:
    """Values of a suspect's parameters at its usual size, at the door."""
    found = []
    for path in suspect.paths:
        effect, _, door = path.partition(".")
        law = CATALOGUE[effect]
        found.append(law.quantities[law.names_at_the_door()[door]].usual)
    absent = zip(found, suspect.absent, strict=True)
    usual = np.array([other if value is None else value for value, other in absent], float)
    if np.array_equal(usual, suspect.absent):
        # A sensor whose usual bandwidth is what the model says: a slower one.
        return suspect.probes[len(suspect.probes) // 2]
    return np.clip(usual, *bounds(suspect.paths))


def _as_next(model: Model, extra: Sequence[Suspect]) -> Model:
    """A model as a new trial would see it, the first after a rest."""
    own = {path: float(min(each)) for suspect in extra for path, each in suspect.own.items()}
    return model.replace(own) if own else model


def _evidence(bench: Bench, model: Model, free: Sequence[str], simulated: Trial) -> Evidence:
    """One simulated trial beside a model."""
    nothing = np.full(len(free), np.inf)
    trial = _as_measured(bench, simulated)
    return Evidence(model, [trial], free, bench.noise, nothing, threads=bench.threads)


def _as_measured(bench: Bench, simulated: Trial) -> Trial:
    """A simulated trial with the signals that the lab measures."""
    known = {name for trial in bench.trials for name in _measured(trial)}
    readings = {name: row for name, row in simulated.measurements.items() if name in known}
    return replace(simulated, measurements=readings, truth={})


def _measured(trial: Trial) -> Iterator[str]:
    for name, row in trial.measurements.items():
        if np.isfinite(row).any():
            yield name


def _proposal(protocol: Protocol, separates: Sequence[str], log_odds: float) -> NextExperiment:
    odds = math.exp(min(log_odds, MOST))
    note = {"note": f"proposed: {protocol.name}"}
    trial = Trial(protocol.trial.time, protocol.trial.commands, provenance=note)
    return NextExperiment(protocol.name, tuple(separates), odds, protocol.minutes, trial)
