"""Score test: how much each candidate could explain, from one simulation of each of its probes.

What a probe changes, times a free factor, is set against the residual. Chance is simulated by
turning the signs of pieces of a quarter of a second of the residual, for the whole catalogue at
once, so the p-value holds for the largest of all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.probe_scores import Baseline, ProbeScores, probe_scores
from pma_gym.discovery.thresholds import SHOWN_GAIN

Array = NDArray[np.float64]

RESAMPLES = 1999
"""Simulated residuals for p-values."""

FACTORS = (0.1, 8.0)
"""By what a probe may be multiplied to start a fit from."""

PROBES = 3
"""How many probes of a candidate are looked at again."""

FINER = 0.005
"""Share of the smallest probe whose being seen for certain asks for smaller probes."""


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
        scores = probe_scores(baseline, whitened, candidate, size)
        finer = _finer(candidate, scores)
        if finer is not candidate:
            scores = probe_scores(baseline, whitened, finer, size)
        looked_at.append(finer)
        probed.append(scores)
        if progress is not None:
            progress(number + 1)
    return _judged(probed, looked_at, seed)


def _finer(candidate: CandidateEffect, scores: ProbeScores) -> CandidateEffect:
    """A candidate with smaller probes where far smaller ones than it has would be seen.

    Usual sizes are those of a station; what an encoder of 50 nm sees of a light axis is less.
    """
    if not candidate.amplitudes.any() or not scores.strengths.any():
        return candidate
    usual = int(np.argmax(scores.strengths))
    # A delay counts from 0, as `grown` has it: a probe at its usual value is no size of 0.
    origin = candidate.absent if candidate.fitted.all() else np.zeros_like(candidate.absent)
    away = np.abs(candidate.probes - origin)[:, candidate.amplitudes]
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


def _judged(
    probed: Sequence[ProbeScores], candidates: Sequence[CandidateEffect], seed: int
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
