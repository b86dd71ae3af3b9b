"""Smooth motion, with its velocity and without a lag, from a noisy record of positions.

The motion is the natural cubic spline s that minimises

    sum w_i (y_i - s(t_i))^2 + lambda int s''^2 dt,   lambda = (2 pi bandwidth)^-4

(Reinsch 1967). It passes slow motion, halves the amplitude at the bandwidth and has no phase shift.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


ENOUGH_ROWS = 8
"""Fewest rows of a record's end that tell how it would go on."""


def smoothed(time: Array, values: Array, bandwidth: float) -> tuple[Array, Array, Array]:
    """Smooth a record, and return its first and second derivative.

    Args:
        time: increasing times (s), shape (n,).
        values: the record (SI), shape (n,).
        bandwidth: frequency (Hz) at which its amplitude is halved.
    Returns:
        The motion and its first and second derivative (SI), shape (n,) each.
    """
    rows = len(time)
    time, values = _continued(time, values, bandwidth)
    parts = _spline(time, values, bandwidth)
    return parts[0][:rows], parts[1][:rows], parts[2][:rows]


def _continued(time: Array, values: Array, bandwidth: float) -> tuple[Array, Array]:
    """A record with a period of the bandwidth more, along the parabola of its last period.

    Without it the spline would end straight, whatever the record does there.
    """
    period = 1.0 / bandwidth
    since = time - time[-1]
    last = since >= -period
    if last.sum() < ENOUGH_ROWS:
        return time, values
    step = float(np.median(np.diff(since[last])))
    more = step * np.arange(1, int(np.ceil(period / step)) + 1)
    parabola = np.polynomial.Polynomial.fit(since[last], values[last], 2)
    return np.append(time, time[-1] + more), np.append(values, parabola(more))


def _spline(time: Array, values: Array, bandwidth: float) -> tuple[Array, Array, Array]:
    """The smoothing spline of a record and its derivatives, as `smoothed`."""
    from scipy.linalg import solveh_banded  # Half of this package's import, for one kind of rig.

    rows = len(time)
    if rows < 3:
        rate = np.zeros(rows) if rows < 2 else np.full(2, np.diff(values) / np.diff(time))
        return values.copy(), rate, np.zeros(rows)
    curvature = np.zeros(rows)
    steps = np.diff(time)
    left, right = 1.0 / steps[:-1], 1.0 / steps[1:]
    middle = -left - right
    # Each reading stands for the time to its neighbours, whatever the clock.
    weights = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    penalty = (2.0 * np.pi * bandwidth) ** -4 / weights
    bands = np.zeros((3, rows - 2))
    bands[2] = (steps[:-1] + steps[1:]) / 3.0
    bands[2] += left**2 * penalty[:-2] + middle**2 * penalty[1:-1] + right**2 * penalty[2:]
    bands[1, 1:] = steps[1:-1] / 6.0
    bands[1, 1:] += middle[:-1] * left[1:] * penalty[1:-2] + right[:-1] * middle[1:] * penalty[2:-1]
    bands[0, 2:] = right[:-2] * left[2:] * penalty[2:-2]
    bends = left * values[:-2] + middle * values[1:-1] + right * values[2:]
    curvature[1:-1] = solveh_banded(bands, bends)
    taken = np.zeros(rows)
    taken[:-2] += left * curvature[1:-1]
    taken[1:-1] += middle * curvature[1:-1]
    taken[2:] += right * curvature[1:-1]
    motion = values - penalty * taken
    slopes = np.diff(motion) / steps
    rate = np.append(slopes - steps * (2.0 * curvature[:-1] + curvature[1:]) / 6.0, 0.0)
    rate[-1] = slopes[-1] + steps[-1] * (curvature[-2] + 2.0 * curvature[-1]) / 6.0
    return motion, rate, curvature


def motion_command(time: Array, positions: Array, bandwidth: float, corner: float) -> Array:
    """Command with which states with two equal poles follow the smooth motion of a record.

    Between rows a command runs straight: where a motion bends, its chords lie h^2 / 12 of its
    curvature inside it on average, h being the time between rows. Position and speed are bent out
    by that; the curvature of a cubic spline does run straight.

    Args:
        time: increasing times (s), shape (n,).
        positions: the record (m), shape (n,).
        bandwidth: bandwidth of the motion (Hz).
        corner: corner frequency of the states (rad/s).
    """
    motion, rate, curvature = smoothed(time, positions, bandwidth)
    command = motion + (2.0 * rate + curvature / corner) / corner
    if len(time) > 2:
        steps = np.diff(time)
        inside = 0.5 * (np.append(steps, steps[-1]) ** 2 + np.append(steps[0], steps) ** 2) / 12.0
        command -= inside * (curvature + 2.0 * np.gradient(curvature, time) / corner)
    # A trial begins where its first command holds the states.
    command[0] = motion[0]
    return command


def level_command(time: Array, levels: Array, bandwidth: float, corner: float) -> Array:
    """Command with which a state with one pole, such as a pressure, follows a smoothed record."""
    level, rate, _ = smoothed(time, levels, bandwidth)
    command = level + rate / corner
    command[0] = level[0]
    return command
