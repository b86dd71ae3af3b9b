"""Where a parameter's law is at its limit: values beyond the scales of the data.

A speed far above all speeds in the trials, or far below, does what an infinite one or none would.
Scales come from the trials and the model; where neither tells, the catalogue's bounds are taken.
"""

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect, bounds
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import unit
from pma_gym.discovery.screening.time_bins import SPEED_ROWS
from pma_gym.discovery.thresholds import FAR_ABOVE, FAR_BELOW
from pma_gym.estimation.logged import Logged
from pma_gym.units import SI_FACTORS

UNITS = {
    "displacement": (("mm", "um"), ("mm/s",)),
    "angle": (("deg",), ("deg/s",)),
    "pressure": (("kPa",), ()),
}
"""Units of parameters that are a travel of a signal, and its speed, by what it measures."""

Array = NDArray[np.float64]


def limits(
    problem: FitProblem, fit: Fitted, chosen: tuple[CandidateEffect, ...], path: str
) -> tuple[float, float]:
    """Values of a parameter, in its unit, at which its law is at its limits.

    Args:
        problem: the trials.
        fit: of a model with effects.
        chosen: the effects.
        path: the parameter.
    """
    (low,), (high,) = bounds([path])
    largest = _scales(problem, fit, chosen).get(unit(path))
    if largest is None:
        return float(low), float(high)
    ends = np.clip([FAR_BELOW * largest, FAR_ABOVE * largest], low, high)
    return (float(ends[0]), float(ends[1])) if ends[0] < ends[1] else (float(low), float(high))


def _scales(
    problem: FitProblem, fit: Fitted, chosen: tuple[CandidateEffect, ...]
) -> dict[str, float]:
    """The largest travel, speed, time and pressure in the trials, by the units of parameters.

    Force over speed or over travel needs none of its own: a force is an amplitude.
    """
    whitened = problem.whitened_at(fit, chosen)
    readings = whitened.readings(fit.values)
    if readings is None:
        return {}
    largest: dict[str, float] = {}
    for held, logged in zip(readings, whitened.logged, strict=True):
        sizes = dict.fromkeys(("s", "ms"), float(logged.time[-1] - logged.time[0]))
        for measures in (("displacement", "angle"), ("pressure",)):
            channel = logged.channel(*measures)
            if channel is None:
                continue
            # A model that lacks much may run away; what was measured did not.
            values, time = _known(logged, held, channel)
            travels, speeds = UNITS[logged.signals[channel].measures]
            sizes |= dict.fromkeys(travels, float(np.ptp(values)))
            sizes |= dict.fromkeys(speeds, float(np.abs(np.gradient(values, time)).max()))
        largest = {name: max(size, largest.get(name, 0.0)) for name, size in sizes.items()}
    return {name: size / SI_FACTORS[name] for name, size in largest.items() if size > 0.0}


def _known(logged: Logged, held: Array, channel: int) -> tuple[Array, Array]:
    """A signal (SI) as measured, else as simulated, and the times (s) of its readings."""
    there = np.full(len(logged.time), bool(logged.measures[channel]))
    there[logged.missing[channel]] = False
    if there.sum() < SPEED_ROWS:
        return held[channel], logged.time
    return logged.measured[channel, there], logged.time[there]
