"""Trials that begin in motion, and the way there that they are given.

A trial is simulated from rest under its first commands. A log that was cut out of a longer one, or
lies behind a gap, begins in motion: the simulation begins elsewhere and catches up only after a
while, and hysteresis and creep begin in another state. Such a trial is given a way there:
commands that come from rest to its first ones, with their speed. Its readings count from when the
way there no longer matters to the model.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.thresholds import (
    BETTER_BEGINNING,
    CERTAIN,
    FORGOTTEN,
    LEAST_COUNTED,
    LEAST_FORGETTING_S,
    LONGER,
    MOVING_SLOPE,
)
from pma_gym.plant import sensors
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

FIRST_S = 0.15
"""Time (s) over which two beginnings are compared with the readings."""

SPEED_S, SPEED_ROWS = 0.06, 6
"""Time (s) and least rows over which the first speed is measured."""

LAST_S, SWEEP_S, AT_REST_S = 0.3, 1.0, 0.3
"""Time of the way there that has the first speed of the commands; time that it takes for their
whole range; time at rest before it (s)."""


@dataclass(frozen=True)
class Start:
    """How a trial begins.

    Attributes:
        trial: with the way there; its readings count from `counts_from`.
        moving: what it begins at, in words.
        counts_from: time from which readings count (s).
    """

    trial: Trial
    moving: str
    counts_from: float

    def words(self, begin: float) -> str:
        """What to say of a trial that begins at a time (s)."""
        led = (
            "commands that lead there from rest are put before it; "
            if self.trial.time[0] < begin
            else ""
        )
        return (
            f"begins {self.moving}: {led}its readings count from {self.counts_from - begin:.2g} s "
            "after its beginning, when the simulation no longer depends on how it began"
        )


def _said_speed(quantity: str, speed: float) -> str:
    """A first speed (SI a second) in words, with what moves."""
    column = BY_QUANTITY[quantity]
    said, unit = f"{abs(speed) / SI_FACTORS[column.unit]:.3g}", column.unit
    if SIGNALS[quantity].shortens:
        said, unit = f"{abs(speed):.2g}", "m"
    return f"at {said} {unit}/s ({column.name}), not at rest"


def moving_start(plant: Plant, trial: Trial) -> str:
    """How fast a trial begins, in words; empty where it may begin at rest.

    The beginning in motion must be clear in the readings alone, and explain them better than one at
    rest: a command that moves from the first row on moves a rig at rest a little later.
    """
    seen = [moving for name in trial.measurements if (moving := _first_speed(trial, name))]
    if not seen:
        return ""
    # Contraction's speed is named where it is known, else the most certain one.
    quantity, speed, _ = max(seen, key=lambda each: (SIGNALS[each[0]].shortens, each[2]))
    way = way_there(plant.model, trial, trial)
    if way is None:
        # No command moves: the readings settle, from where nobody knows.
        return _said_speed(quantity, speed) if _stands(plant.model, trial) else ""
    first = trial.time <= trial.time[0] + FIRST_S
    try:
        rest, moved = _outputs(plant, trial), _outputs(plant, way)[:, -len(trial) :]
    except ValueError:
        return ""
    misfits = np.array([_misfit(plant.model, trial, part, first) for part in (rest, moved)])
    return _said_speed(quantity, speed) if misfits[1] <= BETTER_BEGINNING * misfits[0] else ""


def with_start(plant: Plant, trial: Trial, whole: Trial, moving: str) -> Start | None:
    """A trial that begins in motion, with the way there; None where the model never forgets it.

    Args:
        plant: the model.
        trial: the trial.
        whole: the log that it is a piece of, or itself: its commands' range is the way's.
        moving: how it begins, in words.
    """
    way = way_there(plant.model, trial, whole)
    try:
        rest = _outputs(plant, trial)
        other = _outputs(plant, way)[:, -len(trial) :] if way else _from_no_load(plant, trial)
    except ValueError:
        return None
    scale = FORGOTTEN * _deviations(plant.model)
    measured = np.array([name in trial.measurements for name in plant.outputs])
    apart = np.any(np.abs(other - rest)[measured] > scale[measured, None], axis=0)
    last = int(np.flatnonzero(apart)[-1]) if apart.any() else 0
    begin = float(trial.time[0])
    counts_from = begin + max(LEAST_FORGETTING_S, LONGER * (float(trial.time[last]) - begin))
    if float(trial.time[-1]) - counts_from < LEAST_COUNTED * trial.duration:
        return None
    chosen = trial if way is None else way
    late = chosen.time < counts_from
    readings = {name: np.where(late, np.nan, row) for name, row in chosen.measurements.items()}
    return Start(replace(chosen, measurements=readings), moving, counts_from)


def way_there(model: Model, trial: Trial, whole: Trial) -> Trial | None:
    """A trial with rows before its first that lead from rest to it; None where no command moves.

    A command that rises comes from its least value in the whole log, one that falls from there over
    its largest: so hysteresis starts on the right branch.
    """
    motor, regulator = sensors.voltages(model, trial)
    spans = [(float(np.min(row)), float(np.max(row))) for row in sensors.voltages(model, whole)]
    count = max(SPEED_ROWS, int(np.searchsorted(trial.time, trial.time[0] + SPEED_S)))
    rows = {"motor_voltage": motor, "regulator_voltage": regulator}
    paths = {
        name: _way(trial.time, row, count, *span)
        for (name, row), span in zip(rows.items(), spans, strict=True)
    }
    longest = max(float(times[0]) for times, _ in paths.values())
    if longest <= 0.0:
        return None
    step = float(np.median(np.diff(trial.time)))
    before = np.arange(-int(np.ceil((longest + AT_REST_S) / step)), 0) * step
    led = {
        name: np.interp(-before, times[::-1], levels[::-1])
        for name, (times, levels) in paths.items()
    }
    nothing = np.full(before.size, np.nan)
    return Trial(
        np.concatenate([trial.time[0] + before, trial.time]),
        {name: np.concatenate([led[name], row]) for name, row in rows.items()},
        {name: np.concatenate([nothing, row]) for name, row in trial.measurements.items()},
        provenance=trial.provenance,
    )


def _way(time: Array, row: Array, count: int, low: float, high: float) -> tuple[Array, Array]:
    """Knots of the way to a command's first value: times before it, falling to 0, and volts."""
    slope = float(np.polyfit(time[:count], row[:count], 1)[0]) if count <= row.size else 0.0
    first, span = float(row[0]), high - low
    if span == 0.0 or abs(slope) < 0.01 * span:
        return np.zeros(1), np.array([first])
    # With the commands' speed at the end, faster before: the whole way takes little time.
    near = float(np.clip(first - slope * LAST_S, low, high))
    knots = [(0.0, first), (abs(first - near) / abs(slope), near)]
    turns = [low] if slope > 0.0 else [high, low]
    for level in turns:
        then, volts = knots[-1]
        if level != volts:
            knots.append((then + SWEEP_S * abs(level - volts) / span, level))
    times, levels = np.array(knots, float).T
    return times[::-1], levels[::-1]


def _first_speed(trial: Trial, quantity: str) -> tuple[str, float, float] | None:
    """A signal's speed at the first reading, and in standard errors; None where it is not clear."""
    values = trial.measurements[quantity]
    there = np.flatnonzero(np.isfinite(values))
    if there.size < 2 * SPEED_ROWS:
        return None
    time, values = trial.time[there] - trial.time[there[0]], values[there]
    count = max(SPEED_ROWS, int(np.searchsorted(time, SPEED_S)))
    # A parabola's slope at its beginning: a rig at rest that is set in motion has none there.
    columns = np.stack([np.ones(count), time[:count], time[:count] ** 2], axis=1)
    coefficients, *_ = np.linalg.lstsq(columns, values[:count], rcond=None)
    noise = _noise(values[: max(count, 50)])
    line = float(np.polyfit(time[:count], values[:count], 1)[0])
    error = noise / float(np.sqrt(np.sum((time[:count] - time[:count].mean()) ** 2)))
    sure = abs(line) / error
    if (
        sure < CERTAIN
        or abs(line) < SIGNALS[quantity].least_rate
        or coefficients[1] / line < MOVING_SLOPE
    ):
        return None
    return quantity, line, sure


def _noise(values: Array) -> float:
    """Standard deviation of a signal's noise, by its second differences."""
    bends, steps = np.diff(values, 2), np.abs(np.diff(values))
    quantum = float(np.min(steps[steps > 0.0], initial=np.max(steps)))
    scatter = 1.4826 * float(np.median(np.abs(bends))) / np.sqrt(6.0)
    return max(scatter, quantum / np.sqrt(12.0), 1e-12)


def _stands(model: Model, trial: Trial) -> bool:
    """Whether no command changes at the beginning."""
    first = trial.time <= trial.time[0] + FIRST_S
    return all(float(np.ptp(row[first])) == 0.0 for row in sensors.voltages(model, trial))


def _outputs(plant: Plant, trial: Trial) -> Array:
    """What the sensors would read (SI), shape (signals, rows)."""
    simulated = plant.simulate(trial, noise=False).measurements
    return np.stack([simulated[name] for name in plant.outputs])


def _from_no_load(plant: Plant, trial: Trial) -> Array:
    """The same from rest without a motor's command, which then jumps to the first one."""
    motor, regulator = sensors.voltages(plant.model, trial)
    time = np.concatenate([[trial.time[0] - 1e-3], trial.time])
    commands = {
        "motor_voltage": np.concatenate([[0.0], motor]),
        "regulator_voltage": np.concatenate([regulator[:1], regulator]),
    }
    return _outputs(plant, Trial(time, commands))[:, 1:]


def _deviations(model: Model) -> Array:
    return sensors.deviations(model)


def _misfit(model: Model, trial: Trial, simulated: Array, rows: NDArray[np.bool_]) -> float:
    """Chi-square of the first readings, each signal's zero and size free, by the sensors' noise."""
    total = 0.0
    for name, row, width in zip(model.rig.outputs, simulated, _deviations(model), strict=True):
        measured = trial.measurements.get(name)
        if measured is None:
            continue
        there = rows & np.isfinite(measured)
        if there.sum() >= SPEED_ROWS:
            # A model that is wrong makes a motion larger or smaller; its beginning it does not.
            columns = np.stack([row[there], np.ones(there.sum())], axis=1)
            coefficients, *_ = np.linalg.lstsq(columns, measured[there], rcond=None)
            total += float(np.sum((measured[there] - columns @ coefficients) ** 2)) / width**2
    return total
