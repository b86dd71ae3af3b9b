"""Where fits of a candidate begin: its probes simulated at many sizes, the best first."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.probe_scores import Baseline, probe_scores
from pma_gym.discovery.screening.score_test import PROBES, ScreeningScore

Array = NDArray[np.float64]

SIZES = (0.1, 0.17, 0.3, 0.5, 0.85, 1.4)
"""Factors on a probe at which a closer look simulates it: a dead zone of a size between two of them
still explains most of a burst."""

CLOSER, AT_ONCE = 24, 64
"""How many probes of a candidate a closer look simulates at most, taken evenly, and how many lie in
memory together."""


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
    probed = probe_scores(baseline, whitened, candidate, len(baseline.columns[0]))
    return -2.0 * probed.slopes.sum(axis=1) - probed.strengths


def starting_points(
    baseline: Baseline, whitened: WhitenedResiduals, score: ScreeningScore
) -> list[Array]:
    """Where to begin fits of a candidate: values that explain most as they are, the best first.

    A look takes what a probe changes times a factor; here each is simulated, for a dead zone twice
    as wide does not change twice as much. Where no probe explains anything there are none.
    """
    candidate, tried = score.candidate, []
    for probe, factor in score.starts:
        for each in (factor, np.sign(factor) * np.sqrt(abs(factor)), 1.0, 0.4 * factor):
            values = candidate.grown(probe, float(each))
            if not any(np.array_equal(values, other) for other in tried):
                tried.append(values)
    if not tried:
        return []
    gains = _simulated_gains(baseline, whitened, replace(candidate, probes=np.array(tried)))
    return [tried[k] for k in np.argsort(-gains, kind="stable")]
