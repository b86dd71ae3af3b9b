"""What the selected effects leave of all that was slow in the residual."""

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.findings import Findings
from pma_gym.discovery.noise import slow_part
from pma_gym.discovery.selection import residuals

LEAST_SLOW = 0.02
"""Mean square of a signal's slow residual over that of its noise, below which there is none."""


def leftover_share(found: Findings) -> float:
    """Share of the slow residual, over all signals, that is left; 0 where there was none."""
    bench, selection = found.bench, found.selection
    before = _slow(found, residuals(bench.evidence(found.refitted.model), found.refitted))
    evidence = selection.bench.evidence(selection.fit.model, selection.chosen)
    after = _slow(found, residuals(evidence, selection.fit))
    return float(after.sum() / before.sum()) if before.sum() > LEAST_SLOW else 0.0


def _slow(found: Findings, left: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Slow mean squares of the four signals over those of their noise."""
    rates = [1.0 / np.median(np.diff(each.trial.time)) for each in found.named]
    shares = np.zeros(4)
    for channel, floor in enumerate(found.floors):
        parts = [part[channel] for part in left]
        shares[channel] = slow_part(parts, float(np.median(rates)), floor.level) / floor.level**2
    return shares
