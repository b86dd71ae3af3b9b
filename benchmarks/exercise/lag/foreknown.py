"""Least error of an exercise with the operator's whole course known beforehand.

The regulator's voltages of all control steps, v in 0-10 V, are tried with the very operator
and the very station (`benchmarks.exercise.lag.repeated_exercise`), and improved by Gauss-Newton:

    d = argmin |e + J d|^2 + mu |d|^2,   0 <= v + d <= 10

e is the score's error at the control steps' ends, J its change by each block of voltages, found by
one run for each of them. Of several mu and shares of d the best by the score itself is kept, until
nothing gets better. What the operator does because the angle is another is in J, as is whatever
the station does.

It is an achieved figure: the optimum lies at or below it. Nothing that has to measure, react or
predict can be expected there.

Source:
    Levenberg-Marquardt; the lifted form of a trial as `controllers.models.lifted_model`.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve
from scipy.signal import lfilter

from benchmarks.exercise.lag.repeated_exercise import RATE_HZ, Course, Exertion, RepeatedExercise
from pma_gym.engine.actions import HIGHEST_VOLTAGE
from pma_gym.engine.reset.operators import ANGLES
from pma_gym.plant.exercise_device.device import own_device
from pma_gym.plant.exercise_device.prescription import follow_from
from pma_gym.tasks import PACE

BLOCKS = (4, 1)
"""Control steps of a voltage that J knows of, at first and in the end."""

PROBE_V = 0.05
"""Change of a block's voltage by which J is found (V): friction and hysteresis do not let go of it,
and it stands far above rounding."""

DAMPINGS = (1e-8, 1e-6, 1e-4, 1e-2, 1.0)
"""Values of mu that are tried, of the mean of J'J's diagonal."""

SHARES = (1.0, 0.4, 0.1)
"""Shares of d that are tried."""

ENOUGH, WORTHWHILE = 0.02, 0.001
"""By what share, and by how much (deg or N m), the RMSE of some phase must get better for another
iteration to follow."""

MOST_ITERATIONS = 12
"""With blocks of one length."""


def foreknown_course(
    exertion: Exertion,
    starts: Sequence[NDArray[np.float64]] = (),
    blocks: Sequence[int] = BLOCKS,
) -> Course:
    """The exercise by the best voltages that were found.

    Args:
        exertion: whose.
        starts: voltages that the search may begin with (V), shape (steps,) each, besides those
            that `prescribed` has; it begins with the best of them.
        blocks: control steps of a voltage that J knows of, one search after the other.
    Raises:
        ValueError: a limit ends the exercise with each of them.
    """
    few = RepeatedExercise(exertion, len(DAMPINGS) * len(SHARES))
    tried = [few.course(voltages) for voltages in (*prescribed(few), *starts)]
    best = min(tried, key=lambda course: course.cost)
    if not np.isfinite(best.cost):
        raise ValueError(
            "voltages to begin with must bring the exercise to its end; a limit of the rig or of "
            f"the exercise ends it after {np.isfinite(best.error).sum()} of {few.steps} steps: "
            "give others as starts"
        )
    for block in blocks:
        best = _polished(best, few, RepeatedExercise(exertion, -(-few.steps // block)), block)
    return best


def prescribed(few: RepeatedExercise) -> list[NDArray[np.float64]]:
    """Voltages that any search may begin with (V), shape (steps,) each.

    The one that holds the pressure that the exercise begins at; and where a moment is prescribed
    what the nominal device needs for it at rest, at the angles that the operator is to have.
    """
    held = few.start_voltage()
    constant, exercise = np.full(few.steps, held), few.task.exercise
    if exercise is None or exercise.prescription is None:
        return [constant]
    model = few.exertion.model
    line, plan = model.parameters["regulator_line"], exercise.prescription
    wanted = np.array([plan.at(angle) for angle in ANGLES.tolist()])
    rest = line.gain * held + line.offset
    course = follow_from(model, own_device(model), ANGLES, wanted, rest, exercise.start_moment)
    paces = [PACE.at(step / RATE_HZ) for step in range(few.steps)]
    pressures = np.interp(paces, ANGLES, course.pressure)
    return [constant, np.clip((pressures - line.offset) / line.gain, 0.0, HIGHEST_VOLTAGE)]


def _polished(best: Course, few: RepeatedExercise, many: RepeatedExercise, block: int) -> Course:
    """Improved until no phase gets better any more."""
    for _ in range(MOST_ITERATIONS):
        before, best = best, _improved(best, few, many, block)
        gains = {name: was - best.by_phase[name] for name, was in before.by_phase.items()}
        if all(g < max(ENOUGH * before.by_phase[name], WORTHWHILE) for name, g in gains.items()):
            break
    return best


def _improved(best: Course, few: RepeatedExercise, many: RepeatedExercise, block: int) -> Course:
    """The best of several changes of the voltages, or what there was."""
    slope = _slope(best, many, block)
    tried = [
        np.clip(best.voltages + share * np.repeat(change, block)[: few.steps], 0, HIGHEST_VOLTAGE)
        for change in _changes(best, slope, block)
        for share in SHARES
    ]
    runs = few.run(np.stack(tried, axis=1))
    chosen = int(np.argmin(runs.cost))
    if runs.cost[chosen] >= best.cost:
        return best
    by_phase = {name: float(values[chosen]) for name, values in runs.by_phase.items()}
    return Course(tried[chosen], runs.error[:, chosen], by_phase, best.iterations + 1)


def _slope(best: Course, many: RepeatedExercise, block: int) -> NDArray[np.float64]:
    """J: change of the error by every block's voltage, shape (steps, blocks); 0 beyond an end."""
    columns = np.arange(many.steps) // block
    signs = np.where(best.voltages[::block] > 0.5 * HIGHEST_VOLTAGE, -PROBE_V, PROBE_V)
    voltages = np.repeat(best.voltages[:, None], many.count, axis=1)
    voltages[np.arange(many.steps), columns] += signs[columns]
    error = many.run(voltages).error
    slope = (error - best.error[:, None]) / signs
    return np.where(np.isfinite(slope), slope, 0.0)


def _changes(best: Course, slope: NDArray[np.float64], block: int) -> list[NDArray[np.float64]]:
    """Changes of the blocks' voltages (V) by every mu; within 0-10 V as far as blocks go."""
    square, gradient = slope.T @ slope, slope.T @ best.error
    mean, volts = float(np.mean(np.diag(square))), best.voltages[::block]
    return [_held_change(volts, square, gradient, mu * mean) for mu in DAMPINGS]


def _held_change(
    volts: NDArray[np.float64],
    square: NDArray[np.float64],
    gradient: NDArray[np.float64],
    damping: float,
) -> NDArray[np.float64]:
    """The change (V) of one mu: where it would leave 0-10 V it is held, the others know of it."""
    change, free = np.zeros(len(volts)), np.ones(len(volts), bool)
    for _ in range(4):
        fixed = square[np.ix_(free, ~free)] @ change[~free]
        normal = square[np.ix_(free, free)] + damping * np.eye(int(free.sum()))
        change[free] = solve(normal, -gradient[free] - fixed, assume_a="pos")
        held = np.clip(volts + change, 0.0, HIGHEST_VOLTAGE) - volts
        beyond = held != change
        change = held
        if not (beyond & free).any():
            break
        free &= ~beyond
    return change


def retimed(
    voltages: NDArray[np.float64], lag: float, other: float, period: float = 1.0 / RATE_HZ
) -> NDArray[np.float64]:
    """Voltages by which a regulator of another lag gives about the same pressure, in 0-10 V.

    Args:
        voltages: of every control step (V), shape (steps,).
        lag: time constant of the regulator that they are for (s).
        other: of the one that the new ones are for (s).
        period: of the control steps (s).
    """
    share, others = (-math.expm1(-period / each) for each in (lag, other))
    followed = lfilter([share], [1.0, share - 1.0], voltages - voltages[0]) + voltages[0]
    before = np.append(voltages[0], followed[:-1])
    return np.clip(before + (followed - before) / others, 0.0, HIGHEST_VOLTAGE)
