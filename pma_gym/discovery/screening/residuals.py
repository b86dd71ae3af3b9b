"""What a fit leaves of the readings, and whether that is noise."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.preparation.noise import Whitening, autoregression, step_between
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.autocorrelation import AutocorrelationTest, autocorrelation_test
from pma_gym.discovery.screening.scan_statistic import NO_EXCESS, ScanStatistic, scan_statistic
from pma_gym.discovery.thresholds import LARGEST_NOISE, STRUCTURE

Array = NDArray[np.float64]


def reestimated_noise(
    problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect]
) -> tuple[Whitening, ...]:
    """Whitening of what a fit leaves, never of less than is seen at rest.

    What is left beyond `STRUCTURE` times the noise is structure: no law carries it, and its memory
    is no noise's. Taken for one, it would weigh the instants at which something changes alone,
    where an approximate law is most wrong; so every reading of such a signal counts alike.
    """
    whitened = problem.whitened_residuals(fit.model, chosen)
    left = residuals(whitened, fit)
    filters = []
    for channel, before in enumerate(problem.noise):
        parts = [part[channel] for part in left]
        known = [part for part in parts if np.isfinite(part).any()]
        learnt = autoregression(known, before.level) if known else before
        if known and learnt.level > STRUCTURE * before.level:
            learnt = replace(learnt, coefficients=(), innovation=learnt.level)
        filters.append(replace(learnt, lines=before.lines, drift=before.drift, waves=before.waves))
    return tuple(filters)


def residuals(whitened: WhitenedResiduals, fit: Fitted) -> list[Array]:
    """Simulated less measured (SI), shape (signals, rows) for each trial, nuisances taken out."""
    readings = whitened.readings(fit.values)
    assert readings is not None
    left = simulated_less_measured(whitened, readings)
    return [
        whitened.without_nuisances(logged, part)
        for logged, part in zip(whitened.logged, left, strict=True)
    ]


def innovations(noise: Whitening, part: Array) -> Array:
    """What noise of a known colour does not predict of a residual (SI), scaled to its level.

    NaN where a reading that it needs is missing.
    """
    if not noise.coefficients:
        return part
    missing = np.flatnonzero(~np.isfinite(part))
    white = noise.level * noise.white(np.nan_to_num(part)[None], missing)[0]
    return np.where(np.isfinite(part), white, np.nan)


def simulated_less_measured(whitened: WhitenedResiduals, readings: Sequence[Array]) -> list[Array]:
    """Simulated less measured (SI), shape (signals, rows) for each trial, free zeros taken out."""
    differences = []
    for logged, held in zip(whitened.logged, readings, strict=True):
        left = held - logged.measured
        for channel, signal in enumerate(logged.signals):
            if not logged.measures[channel]:
                left[channel] = np.nan
                continue
            left[channel, logged.missing[channel]] = np.nan
            if signal.has_free_zero:
                left[channel] -= np.nanmean(left[channel])
        differences.append(left)
    return differences


def is_autocorrelated(
    problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect] = ()
) -> bool:
    """Whether the residual of a fit is autocorrelated beyond noise in any signal."""
    return any(each.sure for each in autocorrelation_tests(problem, fit, chosen).values())


def far_off(problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect] = ()) -> bool:
    """Whether what a fit leaves of some signal is many times its noise.

    Where everything is wrong, turning signs of the residual's pieces tells chance from nothing.
    """
    return any(size > LARGEST_NOISE for size in left_in_noises(problem, fit, chosen).values())


def left_in_noises(
    problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect] = ()
) -> dict[str, float]:
    """Root mean square of what a fit leaves of each output, in its noise; 0 where not measured."""
    left = residuals(problem.whitened_residuals(fit.model, chosen), fit)
    sizes = {}
    for channel, (signal, noise) in enumerate(
        zip(fit.model.rig.signals, problem.noise, strict=True)
    ):
        known = np.concatenate([part[channel] for part in left])
        known = known[np.isfinite(known)]
        sizes[signal.name] = float(np.sqrt(np.mean(known**2)) / noise.level) if known.size else 0.0
    return sizes


def autocorrelation_tests(
    problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect] = ()
) -> dict[str, AutocorrelationTest]:
    """Autocorrelation test of the residual of each output.

    Nothing beside a coarse sensor, whose rounding follows the motion.
    """
    if problem.coarse:
        return {}
    whitened = problem.whitened_residuals(fit.model, chosen)
    left, signals = residuals(whitened, fit), whitened.logged[0].signals
    rate = float(np.median([1.0 / np.median(np.diff(trial.time)) for trial in problem.trials]))
    return {
        signal.name: autocorrelation_test(
            [innovations(problem.noise[c], part[c]) for part in left], rate
        )
        for c, signal in enumerate(signals)
    }


def scan_of_fit(problem: FitProblem, fit: Fitted) -> ScanStatistic:
    """Scan statistic of what a fit leaves of all signals; 1 beside a coarse sensor."""
    if problem.coarse:
        return NO_EXCESS
    whitened = problem.whitened_residuals(fit.model)
    left, logged = residuals(whitened, fit), whitened.logged
    edges = [whitened.edges(each) for each in logged]
    scans = [
        scan_statistic(
            [part[c] for part in left], edges, problem.noise[c].level, step_between(logged, c)
        )
        for c in range(len(problem.noise))
    ]
    chance = min(1.0, len(scans) * min(each.chance for each in scans))
    return ScanStatistic(chance, sum(each.excess for each in scans))
