"""Screening: how much each candidate could explain, from one look at each of its probes.

What a probe changes in the signals is made white, and what the model's own parameters could do of
it is projected out. The rest, times a free factor, is set against the residual. Chance is simulated
by turning the signs of pieces of a quarter of a second of the residual, for the whole catalogue at
once, so the p-value holds for the largest of all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect, bounds
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals

Array = NDArray[np.float64]

RESAMPLES = 1999
"""Simulated residuals for p-values."""

SHOWN_GAIN = 25.0
"""Chi-square that an effect must gain to be seen for certain: five standard deviations."""

FACTORS = (0.1, 8.0)
"""By what a probe may be multiplied to start a fit from."""

PROBES = 3
"""How many probes of a candidate are looked at again."""

SIZES = (0.1, 0.17, 0.3, 0.5, 0.85, 1.4)
"""Factors on a probe at which a closer look simulates it: a dead zone of a size between two of them
still explains most of a burst."""

CLOSER, AT_ONCE = 24, 64
"""How many probes of a candidate a closer look simulates at most, taken evenly, and how many lie in
memory together."""

SCANNED, WIDER = 32, 4.0
"""Values of a parameter that a scan of its range simulates, and how far it goes beyond the
probes."""

MILD = 0.05
"""Share of the largest promise over a range that a value must make to be worth a refit."""

FINER = 0.005
"""Share of the smallest probe whose being seen for certain asks for smaller probes."""

LEAST_PART = 1e-6
"""Share of a probe's change that parameters must leave, or it is one of theirs."""

LEAST_CHANGE = 1e-3
"""Root mean square of a probe's change in standard deviations of the noise, at least: what is less
may be steps of the integrator that rounding made fall otherwise."""


@dataclass(frozen=True)
class ScreeningScore:
    """What the best probe of a candidate could explain.

    Attributes:
        candidate: the candidate.
        gain: fall of chi-square.
        p_value: family-wise.
        probe: which probe it is; -1 where none changes anything.
        factor: by which it explains most.
        change: rms of what it then changes beyond what parameters could, over the noise, in the
            signal where that is most.
        resolvable: factor on the usual size from which on it would be seen; None if it never is.
        starts: probes that explain most, with their factors, the best first.
        null: largest gains over the catalogue of simulated residuals, shape (resamples,).
    """

    candidate: CandidateEffect
    gain: float
    p_value: float
    probe: int
    factor: float
    change: float
    resolvable: float | None
    starts: tuple[tuple[int, float], ...]
    null: Array = field(default_factory=lambda: np.empty(0), repr=False, compare=False)

    def p_value_of(self, gain: float) -> float:
        """Family-wise p-value of a gain, such as that of a fit; the score's own without a null."""
        if not self.null.size:
            return self.p_value
        return float((1.0 + np.sum(self.null >= gain)) / (len(self.null) + 1.0))


@dataclass(frozen=True)
class Baseline:
    """The refitted model that candidates are tried beside.

    Attributes:
        whitened: the trials beside it.
        values: its parameters in file units.
        columns: whitened residual and derivatives of each trial, shape (1 + p, signals, rows).
        inverse: of the curvature with the prior, shape (p, p).
    """

    whitened: WhitenedResiduals
    values: Array
    columns: list[Any]
    inverse: Array

    @classmethod
    def at(cls, whitened: WhitenedResiduals, values: Array, steps: Array) -> "Baseline":
        """At parameters, whose derivatives take such steps.

        Raises:
            ValueError: the model cannot be simulated there.
        """
        columns = whitened.columns(np.concatenate([values[None], values + np.diag(steps)]))
        if columns is None:
            raise ValueError("the refitted model cannot be simulated")
        for part in columns:
            part[1:] /= steps[:, None, None].astype(np.float32)
        total = whitened.products(columns).total()
        curvature = total[1:, 1:] + np.diag(whitened.prior**-2.0)
        # A parameter of an effect may change nothing here, and nothing is assumed of it.
        diagonal = np.diag(curvature)
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        inner = np.linalg.pinv(curvature * np.outer(scale, scale), hermitian=True)
        return cls(whitened, values, columns, inner * np.outer(scale, scale))


def screen(
    baseline: Baseline,
    candidates: Sequence[CandidateEffect],
    seed: int,
    whitened_of: Callable[[CandidateEffect], WhitenedResiduals],
    progress: Callable[[int], None] | None = None,
) -> list[ScreeningScore]:
    """Look at every candidate.

    Args:
        baseline: the refitted model.
        candidates: the candidates.
        seed: of the simulated residuals.
        whitened_of: the trials beside the refitted model with a candidate in it, whose parameters
            are free.
        progress: called with the number of candidates that are done.
    """
    size = len(baseline.columns[0])
    looked_at, probed = [], []
    for number, candidate in enumerate(candidates):
        whitened = whitened_of(candidate)
        scores = _probe(baseline, whitened, candidate, size)
        finer = _finer(candidate, scores)
        if finer is not candidate:
            scores = _probe(baseline, whitened, finer, size)
        looked_at.append(finer)
        probed.append(scores)
        if progress is not None:
            progress(number + 1)
    return _judged(probed, looked_at, seed)


@dataclass(frozen=True)
class _Probed:
    """Scores of probes, by pieces: slopes g (n, pieces), strengths h (n,), changes.

    `direct` (n,) is the sum of slopes with nothing projected out: at the best fit chi-square with
    its prior is flat along the model's own parameters, so this is the slope along a probe when they
    follow it. Of the readings alone it is not flat where a prior or a bound holds a parameter.
    """

    slopes: Array
    strengths: Array
    changes: Array
    direct: Array


def _probe(
    baseline: Baseline, whitened: WhitenedResiduals, candidate: CandidateEffect, size: int
) -> _Probed:
    """Scores of a candidate's probes beside the refitted model, which has `size - 1` parameters."""
    tried = np.concatenate([candidate.absent[None], candidate.probes])
    columns = whitened.columns(tried)
    if columns is None:
        columns = _balanced(whitened, tried)
    changes = [part[1:] for part in columns]
    across = np.zeros((size - 1, len(candidate.probes)))
    whole = np.zeros(len(candidate.probes))
    along, own = [], []
    readings = sum(part[0].size for part in changes)
    for logged, ours, theirs in zip(
        baseline.whitened.logged, baseline.columns, changes, strict=True
    ):
        flat = theirs.reshape(len(theirs), -1)
        across += ours[1:].reshape(size - 1, flat.shape[1]) @ flat.T
        whole += np.einsum("ij,ij->i", flat, flat, dtype=np.float64)
        edges = baseline.whitened.edges(logged)[:-1]
        for slopes_by_trial, part in ((along, theirs), (own, ours[1:])):
            slopes = np.einsum("kcr,cr->kr", part, ours[0], dtype=np.float64)
            slopes_by_trial.append(np.add.reduceat(slopes, edges, axis=1))
    weights = baseline.inverse @ across
    strengths = whole - np.sum(across * weights, axis=0)
    seen = (strengths > LEAST_PART * whole) & (whole > LEAST_CHANGE**2 * readings)
    strengths = np.where(seen, strengths, 0.0)
    joined = np.concatenate(along, axis=1)
    slopes = joined - weights.T @ np.concatenate(own, axis=1)
    return _Probed(slopes, strengths, _changes(baseline, changes, weights), joined.sum(axis=1))


def _finer(candidate: CandidateEffect, scores: _Probed) -> CandidateEffect:
    """A candidate with smaller probes where far smaller ones than it has would be seen.

    Usual sizes are those of a station; what an encoder of 50 nm sees of a light axis is less.
    """
    if not candidate.amplitudes.any() or not scores.strengths.any():
        return candidate
    usual = int(np.argmax(scores.strengths))
    away = np.abs(candidate.probes - candidate.absent)[:, candidate.amplitudes]
    sizes = away.max(axis=1) / away[usual].max()
    seen = float(np.sqrt(SHOWN_GAIN / scores.strengths[usual]))
    least = float(sizes.min())
    if seen > FINER * least:
        return candidate
    count = int(np.ceil(np.log10(least / seen)))
    alike = np.flatnonzero(sizes > 1.0 - 1e-9)
    added = [
        (candidate.grown(int(probe), float(factor)), candidate.signs[probe])
        for factor in np.geomspace(seen, least, count, endpoint=False)
        for probe in alike
    ]
    return replace(
        candidate,
        probes=np.concatenate([candidate.probes, [values for values, _ in added]]),
        signs=np.concatenate([candidate.signs, [sign for _, sign in added]]),
    )


def _balanced(whitened: WhitenedResiduals, tried: Array) -> list[Any]:
    """As `_one_by_one`, but those that balance the load go together, which takes far less time."""
    able = whitened.balanced[: len(tried)]
    together = whitened.columns(tried[able]) if able[0] and not able.all() else None
    if together is None:
        return _one_by_one(whitened, tried)
    columns = []
    for part in together:
        whole = np.zeros((len(tried), *part.shape[1:]), part.dtype)
        whole[able] = part
        columns.append(whole)
    return columns


def _one_by_one(whitened: WhitenedResiduals, tried: Array) -> list[Any]:
    """As `Evidence.columns`; a probe that cannot be simulated changes nothing."""
    rows = [whitened.columns(np.stack([tried[0], row])) for row in tried[1:]]
    first = whitened.columns(tried[:1])
    if first is None:
        raise ValueError(f"model {whitened.plant.model.name} cannot be simulated")
    return [
        np.concatenate(
            [part, *(np.zeros_like(part) if row is None else row[i][1:] for row in rows)]
        )
        for i, part in enumerate(first)
    ]


def _changes(baseline: Baseline, changes: Sequence[Any], weights: Array) -> Array:
    """Rms of what each probe changes beyond parameters, over the noise, where that is most."""
    signals = len(baseline.whitened.logged[0].signals)
    squares, counts = np.zeros((weights.shape[1], signals)), np.zeros(signals)
    reduced = weights.T.astype(np.float32)
    for logged, ours, theirs in zip(
        baseline.whitened.logged, baseline.columns, changes, strict=True
    ):
        rest = theirs - np.tensordot(reduced, ours[1:], axes=1)
        squares += np.einsum("kcr,kcr->kc", rest, rest, dtype=np.float64)
        counts += [len(logged.time) * measured for measured in logged.measures]
    return np.sqrt(np.max(squares / np.maximum(counts, 1.0), axis=1))


def _judged(
    probed: Sequence[_Probed], candidates: Sequence[CandidateEffect], seed: int
) -> list[ScreeningScore]:
    generator = np.random.Generator(np.random.Philox(seed))
    pieces = probed[0].slopes.shape[1]
    flips = generator.choice([-1.0, 1.0], size=(RESAMPLES, pieces))
    largest = np.zeros(RESAMPLES)
    for each, candidate in zip(probed, candidates, strict=True):
        drawn = _gains(flips @ each.slopes.T, each.strengths, candidate.signs)
        largest = np.maximum(largest, drawn.max(axis=1, initial=0.0))
    scores = []
    for each, candidate in zip(probed, candidates, strict=True):
        if not each.strengths.any():
            scores.append(ScreeningScore(candidate, 0.0, 1.0, -1, 0.0, 0.0, None, ()))
            continue
        sums = each.slopes.sum(axis=1)
        gains = _gains(sums[None], each.strengths, candidate.signs)[0]
        best = int(np.argmax(gains))
        p_value = (1.0 + np.sum(largest >= gains[best])) / (RESAMPLES + 1.0)
        factors = np.divide(
            -sums, each.strengths, out=np.zeros_like(sums), where=each.strengths > 0
        )
        usual = int(np.argmax(each.strengths))
        scores.append(
            ScreeningScore(
                candidate,
                float(gains[best]),
                float(p_value),
                best,
                float(factors[best]),
                float(abs(factors[best]) * each.changes[best]),
                float(np.sqrt(SHOWN_GAIN / each.strengths[usual])),
                _starts(gains, factors),
                largest,
            )
        )
    return scores


def _gains(slopes: Array, strengths: Array, signs: NDArray[np.bool_]) -> Array:
    """Fall of chi-square by each probe's best factor, which is positive unless signs say so."""
    allowed = np.where((slopes < 0.0) | signs, slopes, 0.0)
    return np.divide(allowed**2, strengths, out=np.zeros_like(allowed), where=strengths > 0.0)


def _starts(gains: Array, factors: Array) -> tuple[tuple[int, float], ...]:
    """The probes that explain most, with their factors."""
    low, high = FACTORS
    return tuple(
        (int(k), float(np.copysign(np.clip(abs(factors[k]), low, high), factors[k])))
        for k in np.argsort(-gains, kind="stable")[:PROBES]
        if gains[k] > 0.0
    )


def refined_score(
    baseline: Baseline, whitened: WhitenedResiduals, score: ScreeningScore
) -> ScreeningScore:
    """A look at a candidate whose probes are simulated at many sizes.

    What comes a little later is not what a look makes of it, a change times a factor: a cable that
    comes taut beats once, at another instant.

    Args:
        baseline: the refitted model.
        whitened: the trials beside it with the candidate in it.
        score: the look so far.
    Returns:
        The same look with the gain that is the larger of the two, and starts from all sizes.
    """
    candidate = score.candidate
    if not len(candidate.probes):
        return score
    starts = list(score.starts)
    for probe in range(0, len(candidate.probes), -(-len(candidate.probes) // CLOSER)):
        starts += [(probe, size) for size in SIZES]
        starts += [(probe, -size) for size in SIZES if candidate.signs[probe]]
    tried = np.array([candidate.grown(probe, factor) for probe, factor in starts])
    gains = np.concatenate(
        [
            _simulated_gains(baseline, whitened, replace(candidate, probes=tried[k : k + AT_ONCE]))
            for k in range(0, len(tried), AT_ONCE)
        ]
    )
    order = [k for k in np.argsort(-gains, kind="stable")[:PROBES] if gains[k] > 0.0]
    best = max(score.gain, float(gains.max()))
    return replace(score, gain=best, starts=tuple(starts[k] for k in order) or score.starts)


def _simulated_gains(
    baseline: Baseline, whitened: WhitenedResiduals, candidate: CandidateEffect
) -> Array:
    """Fall of chi-square by a candidate's probes as they are, parameters free beside them."""
    probed = _probe(baseline, whitened, candidate, len(baseline.columns[0]))
    return -2.0 * probed.slopes.sum(axis=1) - probed.strengths


def starting_points(
    baseline: Baseline, whitened: WhitenedResiduals, score: ScreeningScore
) -> list[Array]:
    """Where to begin fits of a candidate: values that explain most as they are, the best first.

    A look takes what a probe changes times a factor; here each is simulated, for a dead zone twice
    as wide does not change twice as much.
    """
    candidate, tried = score.candidate, []
    for probe, factor in score.starts:
        for each in (factor, np.sign(factor) * np.sqrt(abs(factor)), 1.0, 0.4 * factor):
            values = candidate.grown(probe, float(each))
            if not any(np.array_equal(values, other) for other in tried):
                tried.append(values)
    gains = _simulated_gains(baseline, whitened, replace(candidate, probes=np.array(tried)))
    return [tried[k] for k in np.argsort(-gains, kind="stable")]


@dataclass(frozen=True)
class ScannedRange:
    """Values of a candidate all over its range, simulated, the likeliest first.

    Attributes:
        values: shape (n, parameters).
        promises: how far each lowers chi-square if the model's own parameters follow it along
            straight lines, shape (n,).
        changes: what each changes beyond that, whitened sums of squares, shape (n,).
    """

    values: Array
    promises: Array
    changes: Array

    @property
    def most(self) -> float:
        """The largest promise; 0 without any."""
        return float(self.promises.max(initial=0.0))

    def mildest(self) -> int | None:
        """Which value changes least of those that promise a share of the most; None: none does."""
        promising = np.flatnonzero(self.promises >= MILD * self.most)
        return int(promising[np.argmin(self.changes[promising])]) if self.most > 0.0 else None


def scanned_range(
    baseline: Baseline, whitened: WhitenedResiduals, score: ScreeningScore
) -> ScannedRange:
    """Simulate a candidate's whole range.

    Every parameter of its size is scanned, in steps of equal ratio, at the shapes of the probes; of
    a candidate without a size each parameter is.
    """
    values = _range(score)
    promises, changes = np.empty(len(values)), np.empty(len(values))
    for k in range(0, len(values), AT_ONCE):
        part = replace(score.candidate, probes=values[k : k + AT_ONCE])
        probed = _probe(baseline, whitened, part, len(baseline.columns[0]))
        promises[k : k + AT_ONCE] = -2.0 * probed.direct - probed.strengths
        changes[k : k + AT_ONCE] = probed.strengths
    order = np.argsort(-promises, kind="stable")
    return ScannedRange(values[order], promises[order], changes[order])


def _range(score: ScreeningScore) -> Array:
    """Values all over a candidate's range, shape (n, parameters)."""
    candidate = score.candidate
    if not len(candidate.probes):
        return np.empty((0, len(candidate.paths)))
    sizes = candidate.amplitudes if candidate.amplitudes.any() else candidate.fitted
    if not sizes.any():
        sizes = np.ones(len(candidate.paths), bool)
    lower, upper = bounds(candidate.paths)
    tried = []
    shapes = np.unique(candidate.probes[:, ~sizes], axis=0)
    for place in np.flatnonzero(sizes):
        probed, absent = candidate.probes[:, place], candidate.absent[place]
        # A limit begins at its neutral value, which is never reached; a size counts from there.
        limit = bool(abs(absent) > np.abs(probed).max())
        away = np.abs(probed if limit else probed - absent)
        away = away[away > 0.0]
        if not away.size:
            continue
        least, most = float(away.min()), float(away.max())
        for step in np.geomspace(least / WIDER, most * WIDER, SCANNED):
            for shape in shapes[:: -(-len(shapes) // 3)]:
                for sign in (1.0, -1.0) if candidate.signs.any() and not limit else (1.0,):
                    values = candidate.probes[score.probe].copy()
                    values[~sizes] = shape
                    values[place] = step if limit else absent + sign * step
                    tried.append(np.clip(values, lower, upper))
    return np.unique(np.array(tried), axis=0) if tried else np.empty((0, len(lower)))
