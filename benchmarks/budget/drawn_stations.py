"""The two feed-forwards on stations that are not the one they were computed for."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.budget.causes import OpenLoop, causes_of
from benchmarks.budget.trial import PERIOD_S, simulated_errors
from pma_gym.envs import StationInfo
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import RANDOMISATIONS, TASKS

DRAWN = 16
"""How many stations are drawn."""

RANDOMISATION = "varied"
"""How they are drawn: parameters within their intervals, force and damping within 20 %."""

SEED = 2008
"""Seed of the draws."""

CONTROLLERS = ("serres_feedforward", "improved_feedforward")
"""The two that are compared, by name."""


@dataclass(frozen=True)
class Contest:
    """RMSE over all phases (mm or deg) of both feed-forwards in one trial.

    Attributes:
        task: `displacement` or `rotation`.
        pressure_kpa: of the trial (kPa).
        nominal: on the station that the improved one knows, by controller.
        drawn: on the drawn stations, shape (16,), by controller.
    """

    task: str
    pressure_kpa: float
    nominal: Mapping[str, float]
    drawn: Mapping[str, NDArray[np.float64]]

    @property
    def better(self) -> int:
        """On how many drawn stations the improved one is better."""
        serres, improved = (self.drawn[name] for name in CONTROLLERS)
        return int(np.sum(improved < serres))


def drawn_stations(model: Model | str = "station") -> list[Plant]:
    """The drawn stations, the same for every trial."""
    nominal, draw = load_model(model), RANDOMISATIONS[RANDOMISATION]
    seeds = np.random.SeedSequence(SEED).spawn(DRAWN)
    return [Plant(draw(nominal, np.random.Generator(np.random.Philox(seed)))) for seed in seeds]


def contest(
    task: str, pressure_kpa: float, drawn: list[Plant], model: Model | str = "station"
) -> Contest:
    """Both feed-forwards in a trial, on the nominal station and on drawn ones.

    Args:
        task: `displacement` or `rotation`.
        pressure_kpa: of the trial (kPa).
        drawn: the drawn stations.
        model: the nominal one, which both are computed for.
    """
    nominal = Plant(load_model(model))
    station = StationInfo(nominal.model, TASKS[task], 1e3 * pressure_kpa, PERIOD_S)
    open_loop = OpenLoop(nominal, station)
    faulty = open_loop.voltages(frozenset(causes_of(task)))
    plants, by_plant = [nominal, *drawn], {}
    for name, volts in zip(CONTROLLERS, (faulty, open_loop.improved), strict=True):
        errors = simulated_errors(plants, station, [volts] * len(plants))
        by_plant[name] = np.array([error["all"] for error in errors])
    return Contest(
        task,
        pressure_kpa,
        {name: float(values[0]) for name, values in by_plant.items()},
        {name: values[1:] for name, values in by_plant.items()},
    )
