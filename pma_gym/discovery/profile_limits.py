"""Where a parameter's law is at its limit: values beyond the scales of the data.

A speed far above all speeds in the trials, or far below, does what an infinite one or none would.
Scales come from the trials and the model; where neither tells, the catalogue's bounds are taken.
"""

import numpy as np

from pma_gym.discovery.fits import Bench, Fitted
from pma_gym.discovery.parameters import unit
from pma_gym.discovery.suspects import Suspect, bounds
from pma_gym.plant.plant import OUTPUTS
from pma_gym.units import SI_FACTORS

FAR_ABOVE, FAR_BELOW = 30.0, 1e-4
"""How many times as large as the largest in the trials a value is that does what an infinite one
does; and the share of it that does what none does."""


def limits(
    bench: Bench, fit: Fitted, chosen: tuple[Suspect, ...], path: str
) -> tuple[float, float]:
    """Values of a parameter, in its unit, at which its law is at its limits.

    Args:
        bench: the trials.
        fit: of a model with effects.
        chosen: the effects.
        path: the parameter.
    """
    (low,), (high,) = bounds([path])
    largest = _scales(bench, fit, chosen).get(unit(path))
    if largest is None:
        return float(low), float(high)
    return float(max(low, FAR_BELOW * largest)), float(min(high, FAR_ABOVE * largest))


def _scales(bench: Bench, fit: Fitted, chosen: tuple[Suspect, ...]) -> dict[str, float]:
    """The largest travel, speed, time and pressure in the trials, by the units they are given in.

    Force over speed or over travel needs none of its own: a force is an amplitude.
    """
    evidence = bench.evidence_of(fit, chosen)
    readings = evidence.readings(fit.values)
    if readings is None:
        return {}
    place, travel, speed, pressure, seconds = OUTPUTS.index("contraction"), 0.0, 0.0, 0.0, 0.0
    for held, logged in zip(readings, evidence.logged, strict=True):
        travel = max(travel, float(np.ptp(held[place])))
        speed = max(speed, float(np.abs(np.gradient(held[place], logged.time)).max()))
        pressure = max(pressure, float(np.ptp(held[OUTPUTS.index("pressure")])))
        seconds = max(seconds, float(logged.time[-1] - logged.time[0]))
    si = {"mm": travel, "um": travel, "mm/s": speed, "kPa": pressure, "s": seconds, "ms": seconds}
    return {name: size / SI_FACTORS[name] for name, size in si.items() if size > 0.0}
