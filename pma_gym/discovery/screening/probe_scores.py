"""What a candidate's probes change in the signals beside a refitted model, and how it scores.

What a probe changes is made white, and what the model's own parameters could do of it is projected
out. What is left gives a slope and a strength for each probe.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.preparation.nuisance_projection import LEAST_PART
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals

Array = NDArray[np.float64]

SMALLEST_CHANGE = 1e-3
"""Root mean square of a probe's change in standard deviations of the noise, at least: what is less
may be steps of the integrator that rounding made fall otherwise."""


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


@dataclass(frozen=True)
class ProbeScores:
    """Scores of probes, by pieces: slopes g (n, pieces), strengths h (n,), changes.

    `direct` (n,) is the sum of slopes with nothing projected out: at the best fit chi-square with
    its prior is flat along the model's own parameters, so this is the slope along a probe when they
    follow it. Of the readings alone it is not flat where a prior or a bound holds a parameter.
    """

    slopes: Array
    strengths: Array
    changes: Array
    direct: Array


def probe_scores(
    baseline: Baseline, whitened: WhitenedResiduals, candidate: CandidateEffect, size: int
) -> ProbeScores:
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
    seen = (strengths > LEAST_PART * whole) & (whole > SMALLEST_CHANGE**2 * readings)
    strengths = np.where(seen, strengths, 0.0)
    joined = np.concatenate(along, axis=1)
    slopes = joined - weights.T @ np.concatenate(own, axis=1)
    return ProbeScores(slopes, strengths, _changes(baseline, changes, weights), joined.sum(axis=1))


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
