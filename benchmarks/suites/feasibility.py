"""Feasibility of tasks on a drawn station: infeasible ones do not compare controllers."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.recipe import Recipe
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import Task, broken, limit_in_words, named_task
from pma_gym.units import SI_FACTORS

RAMP_S = 10.0
"""How long a voltage takes to its end when a station is tried (s): twice as long as the motor has
in the tasks, so that what it reaches, it reaches almost at rest."""

SAMPLES = 101
"""Samples of such a ramp."""

LOWEST_PRESSURE = 150e3
"""Lowest pressure of the trials (Pa)."""

LEAST_DAMPING = 0.25
"""Least damping of a drawn muscle, as a share of the nominal one at the lowest pressure: drawn each
from its own interval, the law's two numbers often give none at all."""

Ramp = tuple[dict[str, NDArray[np.float64]], float]
"""True outputs along a ramp (SI), and the contraction that it began at (m)."""


def inability(model: Model, recipe: Recipe) -> str:
    """Return why a station cannot do a recipe's tasks; empty if it can.

    It can if its drive lets go at 0 V, its muscle is damped, its regulator reaches every pressure,
    and a slow ramp of the actuator's voltage ends beyond every task's range, without breaking the
    rig on the way there.
    """
    if model.parameters["drive"].offset > 0.0:
        return "its drive pulls at 0 V"
    damped = _damping(model) / _nominal_damping(recipe)
    if damped < LEAST_DAMPING:
        return f"its damping is {damped:.2g} of the nominal one at {LOWEST_PRESSURE / 1e3:g} kPa"
    plant, ramps = Plant(model), dict[tuple[float, float], Ramp]()
    for name, pressures in recipe.trials.items():
        task = named_task(name)
        assert task is not None
        for pressure_kpa in pressures:
            try:
                which = task.load, 1e3 * pressure_kpa
                if which not in ramps:
                    ramps[which] = _ramp(plant, *which, recipe.reach_v)
                why = _falls_short(plant.model, task, *ramps[which])
            except ValueError as error:
                why = str(error)
            if why:
                return f"{name} at {pressure_kpa:g} kPa: {why}"
    return ""


@lru_cache(maxsize=4)
def _nominal_damping(recipe: Recipe) -> float:
    return _damping(load_model(recipe.model))


def _damping(model: Model) -> float:
    """Damping at the trials' lowest pressure (N s/m), of a law that is linear in pressure."""
    law = model.parameters.get("symmetric_damping")
    if law is None:
        return 1.0
    return law.intercept + law.slope * LOWEST_PRESSURE


def _ramp(plant: Plant, load: float, pressure: float, end_v: float) -> Ramp:
    """A station whose motor's voltage rises, or under a load (N) its regulator's."""
    regulator, drive = plant.regulator_voltage(pressure), plant.model.parameters["drive"]
    motor = (load - drive.offset) / drive.gain if load else 0.0
    rest = plant.settle(motor, regulator_voltage=regulator)
    start = float(rest.state[plant.states.index("contraction")])
    time, held = np.linspace(0.0, RAMP_S, SAMPLES), np.ones(SAMPLES)
    if load:
        states, zero = plant.run(
            time, motor * held, np.linspace(regulator, end_v, SAMPLES), condition=rest
        )
    else:
        states, zero = plant.run(
            time, np.linspace(0.0, end_v, SAMPLES), regulator * held, condition=rest
        )
    return plant.observe(states, zero), start


def _falls_short(
    model: Model, task: Task, truth: dict[str, NDArray[np.float64]], start: float
) -> str:
    """Why a ramp does not reach the end of a task's range; empty if it does."""
    quantity, unit = task.schedule.quantity, task.schedule.unit
    position = truth[quantity] - (start if task.schedule.followed.shortens else 0.0)
    there = int(np.argmax(position >= task.schedule.span))
    if position[there] < task.schedule.span:
        return f"it only reaches {position.max() / SI_FACTORS[unit]:.3g} {unit}"
    codes = broken(model.parameters["limits"], {n: v[: there + 1] for n, v in truth.items()})
    return limit_in_words(model, float(np.max(codes)))
