"""How a trial of a slide that nothing holds began: what its first readings say, and a correction.

A start of 0.2 mm/s more leads 0.2 mm further within a second, far more than a sensor's noise; no
derivative of first readings is that exact. So every trial is simulated once more with another
velocity at its start, and each simulation is moved along the difference to where it meets the
measured contraction best. To first order that is a fit of the starting velocity beside whatever
else is fitted.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

FIRST_S, FIRST_ROWS = 0.05, 8
"""Time (s) and least number of first readings that a start is taken from."""

MOVE = 1e-3
"""By how much a starting velocity is moved for its difference (m/s)."""


def starts(trials: Sequence[Logged]) -> tuple[Array, Array]:
    """Contraction (m) and its rate (m/s) where trials begin, shape (trials,) each."""
    fitted = np.array([_start(logged) for logged in trials])
    return fitted[:, 0], fitted[:, 1]


def meet(states: Array, held: Array, logged: Logged) -> None:
    """Move simulations along what another starting velocity changes, to the measured contraction.

    Args:
        states: of all simulations, the last of which is the first with another starting velocity,
            shape (tried + 1, rows, states); all but the last are changed in place.
        held: what the sensor of contraction holds in them (m), shape (tried + 1, rows).
        logged: what was measured.
    """
    there = _there(logged)
    change = held[-1] - held[0]
    along = change[there] - change[there].mean() if there.any() else np.zeros(1)
    size = float(along @ along)
    if not np.isfinite(size) or size == 0.0:
        return
    off = logged.measured[0, there] - held[:-1][:, there]
    shares = (off @ along) / size
    states[:-1] += shares[:, None, None] * (states[-1] - states[0])


def _start(logged: Logged) -> tuple[float, float]:
    there = np.flatnonzero(_there(logged))
    if len(there) < 3:
        return 0.0, 0.0
    time, values = logged.time[there] - logged.time[0], logged.measured[0, there]
    count = max(FIRST_ROWS, int(np.searchsorted(time, FIRST_S)))
    order = 2 if min(count, len(there)) > 3 else 1
    fitted = np.polynomial.Polynomial.fit(time[:count], values[:count], order)
    return float(fitted(0.0)), float(fitted.deriv()(0.0))


def _there(logged: Logged) -> NDArray[np.bool_]:
    there = np.ones(len(logged.time), bool)
    there[logged.missing[0]] = False
    return there
