"""Initial states of episodes: random draws and equilibria.

Resets of exercises: the operators, the moment that they expect, and the joint's position.
"""

import math
from collections.abc import Iterable, Sequence
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.random import philox, uniform
from pma_gym.engine.option_checks import Pressure
from pma_gym.engine.options import Options
from pma_gym.engine.state_layout import DISTURB, DRAW
from pma_gym.plant.compiled_model import regulator_voltage
from pma_gym.plant.equilibrium import solver
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
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import Program
from pma_gym.tasks import (
    PLAN_ANGLES,
    Events,
    Exercise,
    MomentProfile,
    Operator,
    Task,
    moment_profile,
)

Settled = tuple[NDArray[np.float64], NDArray[np.float64]]
"""State vectors, shape (m, states), and contractions at no load (m), shape (m,)."""


def drawn_pressures(
    task: Task, keys: NDArray[np.int64], episodes: NDArray[np.int64], wanted: Sequence[Pressure]
) -> NDArray[np.float64]:
    """Gauge pressures of episodes (Pa).

    Args:
        task: the task.
        keys: two words of random numbers for each environment, shape (m, 2).
        episodes: numbers of the episodes, shape (m,).
        wanted: as the option `pressure_kpa`, one each.
    """
    low, high = task.starts
    pressures = []
    for share, one in zip(_shares(keys, episodes * 4 + DRAW), wanted, strict=True):
        if isinstance(one, str):
            pressures.append(low + share * (high - low))
        elif isinstance(one, Sequence):
            pressures.append(1e3 * float(one[int(share * len(one))]))
        else:
            pressures.append(1e3 * float(one))
    return np.array(pressures)


def _shares(keys: NDArray[np.int64], streams: NDArray[np.int64]) -> list[float]:
    """A number between 0 and 1 for each key and stream."""
    if len(streams) <= FEW:
        pairs = zip(streams.tolist(), keys.tolist(), strict=True)
        return [uniform(philox((0, stream, 0, 0), tuple(key))[0]) for stream, key in pairs]
    words, counter = keys.astype(np.uint64), streams.astype(np.uint64)
    nothing = np.zeros(len(streams), np.uint64)
    drawn = philox((nothing, counter, nothing, nothing), (words[:, 0], words[:, 1]))
    return uniform(drawn[0]).tolist()


FEW = 8
"""Environments whose numbers are drawn faster one by one than as an array, of the same bits."""


def drawn_events(
    task: Task, options: Options, keys: NDArray[np.int64], episodes: NDArray[np.int64]
) -> Events:
    """Draw the disturbances of episodes; arguments as `drawn_pressures`."""
    return options.disturbing.draw(task.duration, keys, episodes * 4 + DISTURB)


def holding_voltages(
    models: Sequence[Model], pressures: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Regulator voltages for steady pressures (V), each by its station's calibration line.

    Raises:
        ValueError: a pressure that a regulator does not reach.
    """
    pairs = zip(models, pressures.tolist(), strict=True)
    return np.array([regulator_voltage(model, pressure) for model, pressure in pairs])


KEPT = 4096
"""Size of the cache of equilibria: training on drawn stations meets each of them repeatedly."""

_KEEPING = Lock()
_KEPT: dict[tuple[Program, bytes, float], tuple[NDArray[np.float64], float]] = {}


def settled_at_no_load(
    rest: solver.NoLoadEquilibria,
    models: Sequence[Model],
    pressures: NDArray[np.float64],
    regulator: NDArray[np.float64],
    vectors: NDArray[np.float64] | None,
) -> Settled:
    """Find the equilibria of stations with 0 V at the motor.

    Args:
        rest: finds stations of the nominal plant at rest.
        models: each station's model.
        pressures: gauge pressures (Pa), shape (m,).
        regulator: regulator voltages that hold them (V), shape (m,).
        vectors: the models' numbers, shape (m, numbers); None if all are nominal.
    Raises:
        ValueError: no contraction balances the drive's load.
    """
    slack = rest(pressures, vectors)
    if slack is not None:
        return slack
    nominal = rest.plant
    numbers = np.tile(nominal.vector, (len(models), 1)) if vectors is None else vectors
    keys = [
        (nominal.program, row.tobytes(), volts)
        for row, volts in zip(numbers, regulator.tolist(), strict=True)
    ]
    # By what a rest depends on. Those that are asked for twice at once are searched for once.
    # Others may drop what was there a moment ago: what is there is taken once.
    rests = {key: kept for key in keys if (kept := _KEPT.get(key)) is not None}
    new = {key: i for i, key in enumerate(keys) if key not in rests}
    fresh: dict[tuple[Program, bytes, float], tuple[NDArray[np.float64], float]] = {}
    if new:
        at = list(new.values())
        rested = solver.equilibria_at(nominal, np.zeros(len(at)), regulator[at], numbers[at])
        fresh = dict(zip(new, zip(*rested, strict=True), strict=True))
    for key, (state, zero) in fresh.items():
        if np.isnan(zero) or np.isnan(state).any():
            # Says what does not balance.
            Plant(models[new[key]]).settle(motor_voltage=0.0, regulator_voltage=key[2])
    with _KEEPING:
        _KEPT.update(fresh)
        for key in list(_KEPT)[: max(len(_KEPT) - KEPT, 0)]:
            del _KEPT[key]
    rests |= fresh
    states, zeros = zip(*(rests[key] for key in keys), strict=True)
    return np.array(states), np.array(zeros)


def hangs_slack(rest: solver.NoLoadEquilibria, low: float, high: float) -> bool:
    """Whether the cable hangs slack at 0 V, and muscles balance, at all pressures of a range.

    Args:
        rest: finds stations at rest.
        low: lowest gauge pressure (Pa).
        high: highest.
    """
    return rest(np.linspace(low, high, LOOKED_AT)) is not None


LOOKED_AT = 64
"""Pressures of a range at which a balance is looked for."""


def settled_under_load(
    nominal: Plant,
    motor: float,
    regulator: NDArray[np.float64],
    pressures: NDArray[np.float64],
    vectors: NDArray[np.float64] | None,
) -> Settled:
    """Find the equilibria of stations under the motor's load.

    Args:
        nominal: the plant of the nominal model.
        motor: motor voltage (V).
        regulator: regulator voltages (V), shape (m,).
        pressures: gauge pressures that they hold (Pa), shape (m,).
        vectors: the models' numbers, shape (m, numbers); None if all are nominal.
    Raises:
        ValueError: no contraction balances the load.
    """
    states, zero = solver.equilibria_at(nominal, np.full(len(regulator), motor), regulator, vectors)
    lost = np.flatnonzero(np.isnan(states).any(axis=1) | np.isnan(zero))
    if len(lost):
        raise ValueError(
            f"no contraction of model {nominal.model.name} balances the load that the motor holds "
            f"with {motor:.4g} V at {pressures[lost[0]] / 1e3:.4g} kPa; give a higher pressure_kpa "
            "or a task of less load"
        )
    return states, zero


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
