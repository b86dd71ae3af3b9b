"""Trials in short ticks: the residual in each, and the conditions that the plant was in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import VOLTAGE_RANGE
from pma_gym.discovery.thresholds import COMMAND_STEP, COMMAND_STEP_PER_S, MOVING, SLOWEST_M_S
from pma_gym.estimation.logged import Logged
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BIN_S = 0.05
"""Readings of so long (s) are taken together: finer than any region."""

PIECE_BINS = 20
"""Ticks of a piece that is dealt as a whole: a second, longer than the memory of noise and
plant."""

SPEED_ROWS = 3
"""Fewest readings from which a speed is taken."""

SMOOTH_S = 0.03
"""Time over which a speed is taken (s): longer than noise and a slip of dry friction, shorter than
a motion."""


@dataclass(frozen=True)
class TimeBins:
    """All trials in ticks, padded to whole pieces; shape (n,) each unless said otherwise.

    Attributes:
        excess: sum of residual squared less 1, in units of noise, shape (signals, n).
        total: sum of the residual, shape (signals, n).
        counts: readings, shape (signals, n); 0 where a tick is padding.
        pressure: in kPa, as simulated, as all conditions.
        load: force that is measured (N).
        position: contraction (mm).
        speed: of that (mm/s); positive where it grows.
        reversal: time since the last reversal of motion (s); infinite before the first.
        step: time since the last step of a command (s); infinite before the first.
        held: time since the last motion (s), 0 while moving.
        phase: 0 before the first change of a command, 1 from then on, 2 after the last.
        order: number of the trial, as a share of all, 0 to 1.
    """

    excess: Array
    total: Array
    counts: Array
    pressure: Array
    load: Array
    position: Array
    speed: Array
    reversal: Array
    step: Array
    held: Array
    phase: Array
    order: Array


def time_bins(
    logs: Sequence[Logged], readings: Sequence[Array], residuals: Sequence[Array]
) -> TimeBins:
    """All trials in ticks.

    Args:
        logs: the trials.
        readings: what the sensors hold (SI), shape (signals, rows) for each trial.
        residuals: those less what was measured, in units of the noise, NaN where nothing was.
    """
    speeds = [
        _speed(logged.time, logged.row(held, "displacement"))
        for logged, held in zip(logs, readings, strict=True)
    ]
    still = min(SLOWEST_M_S, MOVING * max(float(np.abs(each).max()) for each in speeds))
    steps = _step_sizes(logs)
    parts = []
    for number, (logged, held, residual) in enumerate(zip(logs, readings, residuals, strict=True)):
        order = number / max(len(logs) - 1, 1)
        conditions = _conditions(logged, held, speeds[number], still, steps)
        conditions["order"] = np.full(len(logged.time), order)
        parts.append(_of_trial(logged, conditions, residual))
    return TimeBins(
        **{name: np.concatenate([p[name] for p in parts], axis=-1) for name in parts[0]}
    )


def _of_trial(logged: Logged, conditions: Mapping[str, Array], residual: Array) -> dict[str, Array]:
    time = logged.time
    width = max(BIN_S, float(np.median(np.diff(time)))) if len(time) > 1 else BIN_S
    starts = np.unique(np.floor((time - time[0]) / width + 1e-9), return_index=True)[1]
    known = np.isfinite(residual)
    filled = np.where(known, residual, 0.0)
    sums = {
        "excess": np.where(known, filled**2 - 1.0, 0.0),
        "total": filled,
        "counts": known.astype(float),
    }
    bins = {name: np.add.reduceat(each, starts, axis=1) for name, each in sums.items()}
    # A tick's conditions are those of its middle row.
    middle = (starts + np.append(starts[1:], len(time)) - 1) // 2
    bins |= {name: each[middle] for name, each in conditions.items()}
    spare = -len(starts) % PIECE_BINS
    return {name: _padded(each, spare) for name, each in bins.items()}


def _padded(values: Array, spare: int) -> Array:
    """Some more ticks: without readings, in a condition that lies in no region."""
    if values.ndim > 1:
        return np.pad(values, ((0, 0), (0, spare)))
    return np.pad(values, (0, spare), constant_values=np.nan)


def _step_sizes(logs: Sequence[Logged]) -> tuple[float, float]:
    """Least step of each command."""
    low, high = VOLTAGE_RANGE
    return COMMAND_STEP * max(logged.motor_span for logged in logs), COMMAND_STEP * (high - low)


def _conditions(
    logged: Logged, held: Array, speed: Array, still: float, steps: tuple[float, float]
) -> dict[str, Array]:
    """Conditions of each row, from what is simulated: measured speed is mostly noise."""
    time = logged.time
    moving = np.abs(speed) > still
    direction = np.where(moving, np.sign(speed), 0.0)
    # The direction of the last motion, also while held.
    last = np.maximum.accumulate(np.where(moving, np.arange(len(time)), -1))
    heading = np.where(last >= 0, direction[np.maximum(last, 0)], 0.0)
    turned = np.append(False, heading[1:] * heading[:-1] < 0.0)
    # What never moved has been held since the beginning.
    rested = np.where(last >= 0, time - time[np.maximum(last, 0)], time - time[0])
    changed = np.append(False, (np.diff(logged.motor) != 0) | (np.diff(logged.regulator) != 0))
    phase = np.zeros(len(time))
    if changed.any():
        rows = np.flatnonzero(changed)
        phase[rows[0] :] = 1.0
        phase[rows[-1] + 1 :] = 2.0
    return {
        "pressure": logged.row(held, "pressure") / SI_FACTORS["kPa"],
        "load": logged.row(held, "force"),
        "position": logged.row(held, "displacement") / SI_FACTORS["mm"],
        "speed": speed / SI_FACTORS["mm/s"],
        "reversal": _since(time, turned),
        "step": _since(time, _stepped(logged, steps)),
        "held": np.where(moving, 0.0, np.maximum(rested, 1e-9)),
        "phase": phase,
    }


def _speed(time: Array, position: Array) -> Array:
    if len(time) < SPEED_ROWS:
        return np.zeros(len(time))
    width = max(1, round(SMOOTH_S / float(np.median(np.diff(time)))))
    sums = np.cumsum(np.append(0.0, position))
    half, rows = width // 2, np.arange(len(time))
    first, end = np.maximum(rows - half, 0), np.minimum(rows + half + 1, len(time))
    return np.gradient((sums[end] - sums[first]) / (end - first), time)


def _since(time: Array, event: Mask) -> Array:
    last = np.maximum.accumulate(np.where(event, np.arange(len(time)), -1))
    return np.where(last >= 0, time - time[np.maximum(last, 0)], np.inf)


def _stepped(logged: Logged, steps: tuple[float, float]) -> Mask:
    stepped = np.zeros(len(logged.time), bool)
    for command, least in zip((logged.motor, logged.regulator), steps, strict=True):
        change = np.abs(np.diff(command))
        pace = COMMAND_STEP_PER_S / COMMAND_STEP * np.diff(logged.time)
        stepped[1:] |= (change > least) & (change > least * pace)
    return stepped
