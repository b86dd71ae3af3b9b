"""Rows of a log between which its motion may turn or stand still, by its readings."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

QUIET = 0.1
"""Noise of a speed, as a share of all speeds, up to which neighbouring readings give it."""


def turning(time: Array, readings: Array, noise: float, is_speed: bool) -> NDArray[np.bool_]:
    """Whether the motion may turn or stand still between two rows or those beside them.

    Args:
        time: of each row (s), shape (rows,).
        readings: positions, or speeds; NaN where there are none; shape (rows,).
        noise: standard deviation of a reading, in its unit.
        is_speed: whether readings are speeds.

    Returns:
        One for each row but the first, shape (rows - 1,).
    """
    there = np.flatnonzero(np.isfinite(readings))
    at, values = time[there], readings[there]
    speeds, faint, apart = values, np.full(len(at), noise), 1
    while not is_speed:
        places = np.arange(len(at))
        first, last = (np.clip(places + way, 0, len(at) - 1) for way in (-apart, apart))
        span = at[last] - at[first]
        speeds, faint = (values[last] - values[first]) / span, 2.0**0.5 * noise / span
        if np.mean(faint**2) < QUIET**2 * np.mean(speeds**2) or 8 * apart > len(at):
            break
        apart *= 2
    shown = np.interp(time, at, np.where(np.abs(speeds) > 3.0 * faint, speeds, 0.0))
    slow = shown[1:] * shown[:-1] <= 0.0
    beside = np.pad(slow, 1)
    return beside[:-2] | slow | beside[2:]
