"""Whether an effect is of one size in all trials: what is not has the wrong law."""

from collections.abc import Sequence

import numpy as np

from pma_gym.discovery.fits import Bench, Fitted
from pma_gym.discovery.suspects import Suspect

LEAST_STRENGTH = 3.0
"""Standard errors that an effect must have in a trial for the trial to count."""


def spread(bench: Bench, fit: Fitted, chosen: Sequence[Suspect], place: int) -> float:
    """How much the size of an effect scatters from trial to trial beyond its errors, as a share.

    Each trial alone says how much larger or smaller the effect should be there, all other
    parameters as they are. 0 where fewer than three trials show the effect.
    """
    suspect = chosen[place]
    evidence = bench.evidence(fit.model, chosen)
    pieces = evidence.pieces(fit.values, fit.steps)
    if pieces is None:
        return 0.0
    direction = np.zeros(len(fit.paths))
    for path, absent, scales, fitted in zip(
        suspect.paths, suspect.absent, suspect.amplitudes, suspect.fitted, strict=True
    ):
        if fitted and (scales or len(suspect.paths) == 1):
            at = fit.paths.index(path)
            size = fit.values[at] - (absent if suspect.fitted.all() and scales else 0.0)
            direction[at] = size
    slopes, strengths = [], []
    for trial in range(len(bench.trials)):
        total = pieces.total([trial])
        slopes.append(float(direction @ total[1:, 0]))
        strengths.append(float(direction @ total[1:, 1:] @ direction))
    slope, strength = np.array(slopes), np.array(strengths)
    seen = strength > LEAST_STRENGTH**2
    if seen.sum() < 3:
        return 0.0
    sizes = 1.0 - slope[seen] / strength[seen]
    weights = strength[seen]
    mean = float(weights @ sizes / weights.sum())
    chance = (seen.sum() - 1) / (weights.sum() - (weights**2).sum() / weights.sum())
    beyond = float(weights @ (sizes - mean) ** 2 / weights.sum()) - chance
    return float(np.sqrt(max(0.0, beyond))) / max(abs(mean), 1e-9)
