"""Signals that are late: by how much each lags the given model's simulation.

A sensor that is late alone is a sensor's, or its filter's, affair; several that are late by the
same time point to the log: its readings are stamped later than its commands.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import MEASUREMENTS
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.preparation.data_checks.simulated import Pair
from pma_gym.discovery.thresholds import (
    CORRELATED,
    LAG_LEFT,
    LEAST_LAG_ROWS,
    LEAST_LAG_S,
    SAME_LAG,
    SINGLE_LAG_S,
)

Array = NDArray[np.float64]

MOST_S = 0.25
"""Longest lag that is looked for (s)."""

LEAST_READINGS, LEAST_INNER = 20, 10
"""Fewest readings that tell a lag, in all and away from the ends."""

DIRECT = ("load", "pressure")
"""Signals that follow their commands straight. Friction and hysteresis make motion late, alone."""


def lags(pairs: Sequence[Pair]) -> dict[str, float]:
    """How late each measured signal is (s), where that is clear in most trials that show it."""
    late = {}
    for quantity in MEASUREMENTS:
        each = [lag for pair in pairs if (lag := _lag(pair, quantity)) is not None]
        shown = [lag for lag, clear in each if clear]
        if each and 2 * len(shown) > len(each):
            late[quantity] = float(np.median(shown))
    return late


def words(late: dict[str, float]) -> list[str]:
    """What to say about signals that are late."""
    said, left = [], dict(late)
    while left:
        lag = max(left.values())
        together = [name for name, other in left.items() if lag - other <= SAME_LAG * lag]
        left = {name: other for name, other in left.items() if name not in together}
        names = ", ".join(BY_QUANTITY[name].name for name in together)
        mean = 1e3 * float(np.mean([late[name] for name in together]))
        direct = any(name in DIRECT for name in together)
        if len(together) > 1 and direct:
            said.append(
                f"{names} are late by the same {mean:.3g} ms after the model's simulation: either "
                "the logger stamps its readings later than its commands, or the drive is late; "
                "check the logger before you believe a delay of the drive"
            )
        elif len(together) == 1 and lag >= SINGLE_LAG_S and (direct or len(late) == 1):
            said.append(
                f"{names} alone is late, by {mean:.3g} ms after the model's simulation, whose "
                "parameters move this figure: its sensor lags, or another clock stamps its "
                "readings; a diagnosis names either as that sensor's lag or delay"
            )
    return said


def _lag(pair: Pair, quantity: str) -> tuple[float, bool] | None:
    """Lag of a signal (s), and whether it is clear; None where the signal hardly moves."""
    time, simulated, measured = pair.signal(quantity)
    if time.size < LEAST_READINGS or np.ptp(simulated) <= SIGNALS[quantity].least_span:
        return None
    if abs(float(np.corrcoef(simulated, measured)[0, 1])) < CORRELATED / 2.0:
        return None
    row = float(np.median(np.diff(time)))
    step = max(row / 4.0, 1e-3)
    tried = np.arange(-round(0.05 / step), round(MOST_S / step) + 1) * step
    left = np.array([_left(time, simulated, measured, lag) for lag in tried])
    at = int(np.argmin(left))
    lag = float(tried[at])
    if 0 < at < len(tried) - 1:
        before, here, after = left[at - 1 : at + 2]
        curvature = before - 2.0 * here + after
        lag += step * 0.5 * (before - after) / curvature if curvature > 0.0 else 0.0
    none = _left(time, simulated, measured, 0.0)
    clear = lag >= max(LEAST_LAG_S, LEAST_LAG_ROWS * row) and left[at] <= LAG_LEFT * none
    return lag, bool(clear and at < len(tried) - 1)


def _left(time: Array, simulated: Array, measured: Array, lag: float) -> float:
    """Square of what the simulated signal, so late and times a factor, leaves."""
    inner = (time > time[0] + MOST_S) & (time < time[-1] - 0.05)
    if inner.sum() < LEAST_INNER:
        inner[:] = True
    late = np.interp(time - lag, time, simulated)[inner]
    columns = np.stack([late, np.ones(late.size)], axis=1)
    coefficients, *_ = np.linalg.lstsq(columns, measured[inner], rcond=None)
    return float(np.sum((measured[inner] - columns @ coefficients) ** 2))
