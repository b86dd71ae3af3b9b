"""Resets of exercises: the operators, the moment that they expect, and the joint's position."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.option_checks import Pressure
from pma_gym.engine.options import Options
from pma_gym.engine.state_layout import DRAW
from pma_gym.plant.exercise_device.device import (
    FULL_ANGLE,
    own_device,
    pressure_grid,
    resistive_moment,
)
from pma_gym.plant.exercise_device.prescription import (
    Miss,
    UnreachableError,
    constant_moments,
    follow_from,
)
from pma_gym.plant.model import Model
from pma_gym.tasks import PLAN_ANGLES, Exercise, MomentProfile, Operator, Task, moment_profile

ANGLES = np.radians(np.arange(0.0, 91.0, 10.0))
"""Where a prescription is compared with what the device can give (rad)."""

STRETCH_SHARE = 0.5
"""Share of the rig's limit by which 90 deg may stretch the muscle (assumption)."""

Numbers = dict[str, NDArray[np.float64]]
"""Numbers of environments by their places, shape (m,) each."""


def check_prescription(task: Task, model: Model, wanted: Iterable[Pressure]) -> None:
    """Reject a moment, or 90 deg at a pressure, that a station's device cannot reach.

    Args:
        task: any task.
        model: the nominal model.
        wanted: pressures that episodes are to begin at, as the option `pressure_kpa`.
    Raises:
        UnreachableError: a moment, with the range of moments that can be had.
        ValueError: a pressure at which the muscle does not reach 90 deg, with those at which it
            does.
    """
    exercise = task.exercise
    if exercise is None:
        return
    starts = sorted(_starts(task, wanted))
    if exercise.prescription is None:
        _check_reach(task, model, starts)
        return
    moments = np.array([exercise.prescription.at(angle) for angle in ANGLES.tolist()])
    for pressure in starts:
        try:
            follow_from(model, own_device(model), ANGLES, moments, pressure, exercise.start_moment)
        except UnreachableError as error:
            words = _refusal(task, model, error.miss, pressure)
            raise UnreachableError(error.miss, words=words) from None


def _check_reach(task: Task, model: Model, starts: Sequence[float]) -> None:
    """Refuse pressures at which 90 deg would stretch the muscle too far."""
    every, most = pressure_grid(model), STRETCH_SHARE * model.parameters["limits"].stretch
    given = resistive_moment(model, own_device(model), every, FULL_ANGLE)
    allowed = every[given.contraction >= -most]
    for pressure in starts:
        if not allowed[0] <= pressure <= allowed[-1]:
            raise ValueError(
                f"task {task.name}: pressure_kpa must lie in {1e-3 * allowed[0]:g}-"
                f"{1e-3 * allowed[-1]:g} kPa, where the muscle of model {model.name} reaches 90 "
                f"deg, got {1e-3 * pressure:g}"
            )


def _refusal(task: Task, model: Model, miss: Miss, pressure: float) -> str:
    """What an exercise cannot have that begins at a pressure (Pa), and what it can."""
    between = constant_moments(model, own_device(model), pressure)
    can = "where no one moment can be held from 0 to 90 deg"
    fix = "begin"
    if between is not None:
        low, high = between
        can = f"where one moment can be held from 0 to 90 deg from {low:g} to {high:g} N m"
        fix = "prescribe one of these, or begin"
    lowest, highest = (1e-3 * start for start in task.starts)
    return (
        f"task {task.name}: {miss.wanted:g} N m at {math.degrees(miss.angle):.3g} deg cannot be "
        f"had, beginning at {1e-3 * pressure:.4g} kPa, {can}; {fix} at another pressure_kpa "
        f"(the task's: {lowest:g}-{highest:g})"
    )


def _starts(task: Task, wanted: Iterable[Pressure]) -> set[float]:
    """Pressures to look at (Pa): each that is named, and the ends of the task's range."""
    pressures: set[float] = set()
    for one in wanted:
        several = one if isinstance(one, Sequence) and not isinstance(one, str) else [one]
        pressures |= set(task.starts) if isinstance(one, str) else {1e3 * float(p) for p in several}
    return pressures


def plans(exercise: Exercise, model: Model, pressures: NDArray[np.float64]) -> list[MomentProfile]:
    """Moment over the angle that operators expect.

    The prescribed one; where the speed is prescribed what the nominal device gives at rest at the
    pressure that the trial begins at.

    Args:
        exercise: the exercise.
        model: the nominal model.
        pressures: gauge pressures (Pa), shape (m,).
    """
    if exercise.prescription is not None:
        return [exercise.prescription] * len(pressures)
    angles = np.array(PLAN_ANGLES)
    given = resistive_moment(model, own_device(model), pressures[:, None], angles)
    return [moment_profile(PLAN_ANGLES, row.tolist()) for row in given.moment]


def operators(
    task: Task,
    options: Options,
    model: Model,
    keys: NDArray[np.int64],
    episodes: NDArray[np.int64],
    pressures: NDArray[np.float64],
    regulator: NDArray[np.float64],
) -> Numbers:
    """Numbers of the operators of episodes, and of what the rig's computer knows.

    Args:
        task: an exercise.
        options: the environment's options.
        model: the nominal model.
        keys: two words of random numbers for each environment, shape (m, 2).
        episodes: numbers of the episodes, shape (m,).
        pressures: gauge pressures that they begin at (Pa), shape (m,).
        regulator: regulator voltages that hold these (V), shape (m,).
    """
    exercise = task.exercise
    assert exercise is not None
    people = _people(exercise, options, keys, episodes)
    numbers = {f"operator_{name}": people[:, i] for i, name in enumerate(Operator._fields)}
    rise = numbers["operator_rise"]
    numbers["operator_share"] = -np.expm1(-options.period / rise)
    known = plans(exercise, model, pressures)
    numbers["plan_first"] = np.array([plan.first for plan in known])
    for what in ("angles", "slopes"):
        rows = np.array([getattr(plan, what) for plan in known]).reshape(len(known), -1)
        numbers |= {f"plan_{what[:-1]}_{i}": rows[:, i] for i in range(rows.shape[1])}
    drive, line, lag = (model.parameters[n] for n in ("drive", "regulator_line", "regulator_lag"))
    common = {
        "nominal_radius": model.parameters["rotor"].radius,
        "nominal_drive_gain": drive.gain,
        "nominal_drive_offset": drive.offset,
        "nominal_line_gain": line.gain,
        "nominal_line_offset": line.offset,
        "nominal_lag_share": -math.expm1(-options.period / lag.time_constant),
        "operator_state_drive": exercise.start_moment,
        "operator_state_freshness": 1.0,
        "operator_moment": exercise.start_moment,
    }
    numbers |= {name: np.full(len(known), value) for name, value in common.items()}
    if options.safety:
        numbers["safety_moment"] = np.full(len(known), exercise.start_moment)
        numbers["safety_pressure"] = line.gain * regulator + line.offset
    return numbers


def _people(
    exercise: Exercise, options: Options, keys: NDArray[np.int64], episodes: NDArray[np.int64]
) -> NDArray[np.float64]:
    if options.operator == "random":
        return exercise.population.draw(keys, episodes * 4 + DRAW)
    typical = exercise.population.typical
    one = options.operator if isinstance(options.operator, Operator) else typical
    return np.tile(np.array(one), (len(keys), 1))


def wound_back(
    names: tuple[str, ...],
    states: NDArray[np.float64],
    zero: NDArray[np.float64],
    radii: NDArray[np.float64],
) -> None:
    """Shift the zero of the angle to the start of an exercise, where the cable is already wound in.

    Args:
        names: of the states.
        states: shape (m, states); changed.
        zero: contraction at which the cable begins to be wound in (m), shape (m,); changed.
        radii: of the pulleys (m), shape (m,).
    """
    at = names.index("angle")
    angles = states[:, at].copy()
    zero -= radii * angles
    for name in ("angle", "lag_potentiometer"):
        if name in names:
            states[:, names.index(name)] -= angles
