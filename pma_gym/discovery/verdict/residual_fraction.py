"""The fraction of the slow and of the autocorrelated residual that the selected effects leave."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.preparation.noise import slow_part, sparse
from pma_gym.discovery.preparation.quantisation import is_coarse
from pma_gym.discovery.screening.autocorrelation import autocorrelation_test, tone
from pma_gym.discovery.screening.residuals import innovations, residuals
from pma_gym.discovery.thresholds import LEAST_SLOW
from pma_gym.discovery.verdict.findings import Findings


@dataclass(frozen=True)
class ResidualFraction:
    """What the selected effects leave, as shares over all signals; 0 where there was nothing.

    Attributes:
        slow: of what was slow in the residual.
        autocorrelated: of its autocorrelated part, where that is still more than chance.
    """

    slow: float
    autocorrelated: float

    @property
    def most(self) -> float:
        """The larger."""
        return max(self.slow, self.autocorrelated)


def residual_fraction(findings: Findings) -> ResidualFraction:
    """What the selected effects leave."""
    problem, selection = findings.problem, findings.selection
    begun = residuals(problem.whitened_residuals(findings.refitted.model), findings.refitted)
    before = _slow(findings, begun)
    whitened = selection.problem.whitened_residuals(selection.fit.model, selection.chosen)
    after = _slow(findings, residuals(whitened, selection.fit))
    # What may be chance before has no share afterwards. Of a few readings no memory is known.
    seldom = [sparse([part[channel] for part in begun]) for channel in range(len(begun[0]))]
    there = (before[1] > 0.0) | np.array(seldom)
    shares = [
        float(now[there].sum() / then[there].sum()) if then[there].sum() > LEAST_SLOW else 0.0
        for then, now in zip(before, after, strict=True)
    ]
    return ResidualFraction(*shares)


def tones(findings: Findings) -> dict[str, float]:
    """Frequency (Hz) of each signal, by column, whose residual after the refit oscillates."""
    whitened = findings.problem.whitened_residuals(findings.refitted.model)
    left, rate, hertz = residuals(whitened, findings.refitted), _rate(findings), {}
    for channel, signal in enumerate(whitened.logged[0].signals):
        kept = tone([part[channel] for part in left], rate)
        if kept is not None:
            hertz[signal.column] = kept.hertz
    return hertz


def _rate(findings: Findings) -> float:
    """Usual readings a second."""
    return float(np.median([1.0 / np.median(np.diff(each.trial.time)) for each in findings.named]))


def _slow(findings: Findings, left: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Mean squares of the signals' slow and autocorrelated parts over those of their noise."""
    rate = _rate(findings)
    shares = np.zeros((2, len(findings.floors)))
    for channel, floor in enumerate(findings.floors):
        # Of the colour that is known from rest and repeats; what is missing must not hide in it.
        noise = findings.problem.noise[channel]
        parts = [innovations(noise, part[channel]) for part in left]
        shares[0, channel] = slow_part(parts, rate, floor.level) / floor.level**2
        kept = autocorrelation_test(parts, rate)
        # What a coarse sensor loses between its steps follows the motion, and no effect carries it.
        if kept.sure and not is_coarse(floor):
            shares[1, channel] = kept.share * kept.variance / floor.level**2
    return shares
