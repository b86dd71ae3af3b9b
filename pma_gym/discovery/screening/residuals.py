"""What a fit leaves of the readings, and whether that is noise."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import Suspect
from pma_gym.discovery.fitting.fit_problem import Bench, Fitted
from pma_gym.discovery.preparation.noise import Whitening, autoregression, step_between
from pma_gym.discovery.preparation.whitened_residuals import Evidence
from pma_gym.discovery.screening.autocorrelation import Memory, memory
from pma_gym.discovery.screening.scan_statistic import NO_BURSTS, Bursts, bursts
from pma_gym.plant.compiled_model import OUTPUTS

Array = NDArray[np.float64]

FAR = 10.0
"""Residual (root mean square), in standard deviations of a signal's noise, from which on it is no
noise whatever its form."""


def relearnt(bench: Bench, fit: Fitted, chosen: Sequence[Suspect]) -> tuple[Whitening, ...]:
    """Whitening of what a fit leaves, never of less than is seen at rest."""
    evidence = bench.evidence(fit.model, chosen)
    left = residuals(evidence, fit)
    found = []
    for channel, before in enumerate(bench.noise):
        parts = [part[channel] for part in left]
        known = [part for part in parts if np.isfinite(part).any()]
        found.append(autoregression(known, before.level) if known else before)
    return tuple(found)


def residuals(evidence: Evidence, fit: Fitted) -> list[Array]:
    """Simulated less measured (SI), shape (4, rows) for each trial, free zeros taken out."""
    readings = evidence.readings(fit.values)
    assert readings is not None
    return left_over(evidence, readings)


def left_over(evidence: Evidence, readings: Sequence[Array]) -> list[Array]:
    """Simulated less measured (SI), shape (4, rows) for each trial, free zeros taken out."""
    found = []
    for logged, held in zip(evidence.logged, readings, strict=True):
        left = held - logged.measured
        for channel, name in enumerate(OUTPUTS):
            if not logged.measures[channel]:
                left[channel] = np.nan
                continue
            left[channel, logged.missing[channel]] = np.nan
            if name in ("contraction", "rotation"):
                left[channel] -= np.nanmean(left[channel])
        found.append(left)
    return found


def remembers(bench: Bench, fit: Fitted, chosen: Sequence[Suspect] = ()) -> bool:
    """Whether what a fit leaves remembers itself and is surely no noise, whatever is hidden."""
    return any(each.sure for each in memories(bench, fit, chosen).values())


def far_off(bench: Bench, fit: Fitted, chosen: Sequence[Suspect] = ()) -> bool:
    """Whether what a fit leaves of some signal is many times its noise.

    Where everything is wrong, turning signs of the residual's pieces tells chance from nothing.
    """
    left = residuals(bench.evidence(fit.model, chosen), fit)
    for channel, noise in enumerate(bench.noise):
        known = np.concatenate([part[channel] for part in left])
        known = known[np.isfinite(known)]
        if known.size and np.sqrt(np.mean(known**2)) > FAR * noise.level:
            return True
    return False


def memories(bench: Bench, fit: Fitted, chosen: Sequence[Suspect] = ()) -> dict[str, Memory]:
    """What the rest that a fit leaves of each output remembers of itself.

    Nothing beside a coarse sensor, whose rounding follows the motion; nor of a slide, whose starts
    are taken from readings, so that what is left remembers their noise.
    """
    if not _tells(bench):
        return {}
    left = residuals(bench.evidence(fit.model, chosen), fit)
    rate = float(np.median([1.0 / np.median(np.diff(trial.time)) for trial in bench.trials]))
    return {name: memory([part[c] for part in left], rate) for c, name in enumerate(OUTPUTS)}


def burst_of(bench: Bench, fit: Fitted) -> Bursts:
    """The bursts in what a fit leaves of all signals; none where `remembers` cannot say either."""
    if not _tells(bench):
        return NO_BURSTS
    evidence = bench.evidence(fit.model)
    left, logged = residuals(evidence, fit), evidence.logged
    edges = [evidence.edges(each) for each in logged]
    found = [
        bursts([part[c] for part in left], edges, bench.noise[c].level, step_between(logged, c))
        for c in range(len(OUTPUTS))
    ]
    chance = min(1.0, len(found) * min(each.chance for each in found))
    return Bursts(chance, sum(each.excess for each in found))


def _tells(bench: Bench) -> bool:
    """Whether a residual tells of itself what is noise."""
    return not bench.coarse and bench.given.plant != "slide"
