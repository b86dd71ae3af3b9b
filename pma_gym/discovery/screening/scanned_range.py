"""A candidate simulated all over its range, where its probes alone may miss what explains."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.probe_scores import Baseline, probe_scores
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.screening.starting_points import AT_ONCE
from pma_gym.discovery.thresholds import LEAST_GAIN, WORTH_A_FIT

Array = NDArray[np.float64]

SCANNED, WIDER = 32, 4.0
"""Values of a parameter that a scan of its range simulates, and how far it goes beyond the
probes."""


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
        least = max(WORTH_A_FIT * self.most, min(self.most, LEAST_GAIN))
        promising = np.flatnonzero(self.promises >= least)
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
        probed = probe_scores(baseline, whitened, part, len(baseline.columns[0]))
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
    lower, upper = candidate.bounds
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
