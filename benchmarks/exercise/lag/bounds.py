"""Bounds of three kinds on the error of an exercise that the regulator's lag sets.

    foreknown   best RMSE of somebody who knows the operator's course: with the lag as it is, with
                twice of it and with hardly any (`benchmarks.exercise.lag.foreknown`)
    causal      least angle or moment error against an unsteady operator of who sees all, but no
                future (`benchmarks.exercise.lag.causal`)
    swing       the largest moment of a frequency that the regulator can cancel
                (`benchmarks.exercise.lag.swing`)

The first says what lag and 0-10 V cost whoever can plan, the second what the lag costs whoever must
react, the third where the regulator's reach ends.

`python -m benchmarks lag` prints and keeps them.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.exercise.lag.causal import Causal, causal_bounds
from benchmarks.exercise.lag.foreknown import foreknown_course, retimed
from benchmarks.exercise.lag.repeated_exercise import LAG, NO_LAG, Course, Exertion, own_floor
from benchmarks.exercise.lag.swing import Swing, swings
from pma_gym.engine.option_checks import Pressure
from pma_gym.plant.model import Model, load_model
from pma_gym.tasks import EVERY_TASK, Operator

FIRST_SEED = 1_000_000
"""Seed of the first frozen operator; seeds of training lie below."""

OPERATORS = 8
"""How many frozen operators."""

LAG_FACTORS = (0.0, 1.0, 2.0)
"""Lags as shares of the model's; 0 stands for hardly any, `NO_LAG`."""


@dataclass(frozen=True)
class Foreknown:
    """The best that was found for one operator, one start pressure and one lag.

    Attributes:
        task: name of the exercise.
        seed: of the environment.
        pressure_kpa: gauge pressure that it begins at (kPa), or "random" for one by the seed.
        lag: time constant of the regulator (s).
        safety: whether the safety layer stood between.
        by_phase: RMSE by phase, achieved (deg or N m).
        floor: RMSE of phase I that is the operator's own (deg); 0 where the moment is held.
        saturated: share of the steps at 0 or 10 V.
        iterations: of the search.
    """

    task: str
    seed: int
    pressure_kpa: Pressure
    lag: float
    safety: bool
    by_phase: Mapping[str, float]
    floor: float
    saturated: float
    iterations: int


@dataclass(frozen=True)
class LagBounds:
    """All bounds of an exercise.

    Attributes:
        foreknown: one for each operator, pressure, lag and safety.
        causal: one for each angle, pressure and lag.
        swings: one for each angle and pressure.
    """

    foreknown: Sequence[Foreknown]
    causal: Sequence[Causal]
    swings: Sequence[Swing]


def lag_bounds(
    task: str,
    seeds: Iterable[int] = range(FIRST_SEED, FIRST_SEED + OPERATORS),
    pressures_kpa: Sequence[Pressure] = ("random",),
    factors: Sequence[float] = LAG_FACTORS,
    safeties: Sequence[bool] = (False,),
    model: str | Model = "station",
    on_row: Callable[[], None] = lambda: None,
) -> LagBounds:
    """Every bound of an exercise.

    Args:
        task: its name.
        seeds: of the frozen operators.
        pressures_kpa: gauge pressures that episodes begin at (kPa), or "random".
        factors: lags as shares of the model's, 0 for hardly any.
        safeties: without the safety layer, with it, or both.
        model: the station, with the lag that it has.
        on_row: called as each `Foreknown` is done.
    """
    station, rows = load_model(model), []
    for row in foreknown_bounds(task, seeds, pressures_kpa, factors, safeties, station):
        rows.append(row)
        on_row()
    return LagBounds(tuple(rows), causal_bounds(task, station), swings(task, station))


def foreknown_bounds(
    task: str,
    seeds: Iterable[int],
    pressures_kpa: Sequence[Pressure],
    factors: Sequence[float],
    safeties: Sequence[bool],
    model: Model,
    operator: str | Operator = "random",
) -> Iterator[Foreknown]:
    """Compute the bounds with the operator's course known, per operator; see `lag_bounds`."""
    for seed in seeds:
        for pressure in pressures_kpa:
            exertion = Exertion(task, seed, model, pressure, operator)
            paced = EVERY_TASK[task].schedule.followed.is_angle
            floor = own_floor(exertion) if paced else 0.0
            lags = [lag_of(model, factor) for factor in factors]
            for lag, free in courses_by_lag(exertion, lags).items():
                for safety in safeties:
                    yield _foreknown(exertion, lag, floor, safety, free)


def courses_by_lag(exertion: Exertion, lags: Sequence[float]) -> dict[float, Course]:
    """The best course by each lag (s), the regulator's voltages of one tried for the next.

    A joint that chatters at the end of its reach may hold a search up; another lag leads out of it.
    """
    own, courses = lag_of(exertion.model, 1.0), dict[float, Course]()
    for lag in (own, *lags, own):
        source = min(courses, key=lambda each: courses[each].cost, default=None)
        if lag in courses and source == lag:
            continue
        starts = [] if source is None else [retimed(courses[source].voltages, source, lag)]
        course = foreknown_course(_slowed(exertion, lag), starts)
        if lag not in courses or course.cost < courses[lag].cost:
            courses[lag] = course
    return {lag: courses[lag] for lag in lags}


def _slowed(exertion: Exertion, lag: float) -> Exertion:
    return replace(exertion, model=exertion.model.replace({LAG: lag}))


def lag_of(model: Model, factor: float) -> float:
    """Time constant of a regulator so many times as slow as the model's (s)."""
    return factor * model.parameters["regulator_lag"].time_constant if factor else NO_LAG


def _foreknown(
    exertion: Exertion, lag: float, floor: float, safety: bool, free: Course
) -> Foreknown:
    """Without the safety layer, or the best behind it: what it holds back has no slope to follow.

    Its search begins with what was best without it.
    """
    guarded = replace(_slowed(exertion, lag), safety=True)
    course = foreknown_course(guarded, [free.voltages]) if safety else free
    return Foreknown(
        str(exertion.task),
        exertion.seed,
        exertion.pressure_kpa,
        lag,
        safety,
        course.by_phase,
        floor,
        course.saturated,
        course.iterations,
    )


def medians(rows: Iterable[Foreknown]) -> dict[str, float]:
    """Median over operators of every phase's RMSE (deg or N m)."""
    listed = list(rows)
    return {
        name: float(np.median([row.by_phase[name] for row in listed]))
        for name in listed[0].by_phase
    }
