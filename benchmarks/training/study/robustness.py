"""Conditions that no policy was trained with: beside PID and LQG, on stations of the validation."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.report.statistics import interquartile_mean
from benchmarks.runner.rollout import rollout
from benchmarks.training.stations import VALIDATION_FIRST, Stations
from benchmarks.training.validation import measure_of
from controllers import CONTROLLERS, Policy
from controllers.controller import Controller
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import Model, load_model
from pma_gym.tasks import named_task, phase_rmse
from pma_gym.units import SI_FACTORS

STATIONS = 24
"""How many stations each condition is tried on."""

RIVALS = ("pid", "feedforward_pid", "lqg")
"""Controllers that are tried beside the policies."""

SEED = 5_000_000
"""Seed of the first episode's noise."""

NOISE = ("lvdt.noise_mm", "potentiometer.noise_deg", "load_cell.noise_n")
"""Parameters of the sensors' noise."""


class Condition(NamedTuple):
    """Something that a policy was not trained with.

    Attributes:
        title: in words.
        options: of the environment.
        noise: factor on the sensors' noise.
        pressures_kpa: by task, in turn.
    """

    title: str
    options: Mapping[str, Any] = {}
    noise: float = 1.0
    off_grid: bool = False


CONDITIONS = (
    Condition("as trained"),
    Condition("pressures between those trained on", off_grid=True),
    Condition("commands 10 ms late", {"action_delay_s": 0.01}),
    Condition("commands 20 ms late", {"action_delay_s": 0.02}),
    Condition("readings 10 ms old", {"observation_delay_s": 0.01}),
    Condition("three times the sensors' noise", noise=3.0),
    Condition("regulator jumps, somebody pulls", {"disturbances": "regulator_and_hand_push"}),
    Condition("200 Hz", {"control_rate_hz": 200.0}),
)


def pressures_kpa(task: str, off_grid: bool) -> list[float]:
    """Pressures of the episodes (kPa), of those trained on or halfway between them."""
    known = named_task(task)
    assert known is not None
    low, high = 1e-3 * known.lowest_pressure, 1e-3 * known.highest_pressure
    steps = np.arange(low, high - 25.0, 50.0)
    return [float(p) + (12.5 if off_grid else 0.0) for p in steps]


def robustness(
    task: str, policies: Mapping[str, Any], report: Callable[[str], None] = print
) -> dict[str, dict[str, float]]:
    """Interquartile mean error (mm or deg) by condition and controller.

    Args:
        task: displacement or rotation.
        policies: path of a policy file by what it is called.
        report: called with a line for each condition.
    """
    errors: dict[str, dict[str, float]] = {}
    for condition in CONDITIONS:
        makers: dict[str, Callable[[], Controller]] = {n: CONTROLLERS[n] for n in RIVALS}
        for name, path in policies.items():
            makers[name] = lambda path=path: Policy(path, anywhere=True)
        errors[condition.title] = {
            name: float(interquartile_mean(_errors(task, condition, make)))
            for name, make in makers.items()
        }
        report(f"{task}, {condition.title}: {errors[condition.title]}")
    return errors


def _errors(task: str, condition: Condition, make: Callable[[], Controller]) -> NDArray[np.float64]:
    stations, nominal = Stations("robust", VALIDATION_FIRST, STATIONS), load_model("station")
    pressures, controller = pressures_kpa(task, condition.off_grid), make()
    errors = [
        _error(
            task,
            _noisy(stations.of(i), condition.noise),
            pressures[i % len(pressures)],
            condition.options,
            controller,
            SEED + i,
            nominal,
        )
        for i in range(STATIONS)
    ]
    return np.array(errors)


def _noisy(model: Model, factor: float) -> Model:
    if factor == 1.0:
        return model
    changed = {}
    for path in NOISE:
        effect, _, file_key = path.partition(".")
        changed[path] = factor * float(model.values_in_files(effect)[file_key])  # type: ignore[arg-type]
    return model.replace(changed)


def _error(
    task: str,
    model: Model,
    pressure_kpa: float,
    options: Mapping[str, Any],
    controller: Controller,
    seed: int,
    nominal: Model,
) -> float:
    environment = PMAEnv(task, model=model, pressure_kpa=pressure_kpa, **options)
    done = rollout(environment, controller, seed, nominal)
    phases: Sequence[Any] = environment.task.schedule.phases
    row: dict[str, Any] = {"task": task, "failure": done.ended_by, "phases": {}}
    if not done.ended_by:
        unit = SI_FACTORS[environment.task.schedule.unit]
        by_phase = phase_rmse(environment.task.schedule, done.position)
        row["phases"] = {p.name: {"rmse": by_phase[p.name] / unit} for p in phases}
    return measure_of(task).of_row(row)
