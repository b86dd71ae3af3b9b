"""The budget of one trial: every set of faults simulated, and what follows from that."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.bounds.open_loop import open_loop_positions
from benchmarks.budget.causes import OpenLoop, causes_of, without
from benchmarks.runner.phase_score import measured_score
from pma_gym.envs import StationInfo
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import TASKS, phase_rmse
from pma_gym.units import SI_FACTORS

PERIOD_S = 0.01
"""Control period (s): 100 Hz, as in the reproduction of the dissertation."""

AT_ONCE = 32
"""Trials that are simulated together; more would need more memory, not less time."""

Errors = Mapping[str, float]
"""RMSE (mm or deg) by phase, and of `all` phases."""

WITHOUT = {
    "station: no hysteresis": "hysteresis",
    "station: no dry friction": "dry friction",
    "station: no slack": "slack",
}
"""Stations that lack something, under the printed voltages."""


@dataclass(frozen=True)
class Budget:
    """Error budget of the printed feed-forward in one trial; RMSE in mm or deg.

    Attributes:
        task: `displacement` or `rotation`.
        pressure_kpa: of the trial (kPa).
        causes: its faults, in the order in which they are taken away.
        resultss: errors of the controller with each set of faults.
        improved: errors of the improved feed-forward.
        variants: errors of the printed voltages with one thing changed, by what is changed.
        measured: errors of the dissertation's own trial.
    """

    task: str
    pressure_kpa: float
    causes: tuple[str, ...]
    resultss: Mapping[frozenset[str], Errors]
    improved: Errors
    variants: Mapping[str, Errors]
    measured: Errors

    @property
    def phases(self) -> tuple[str, ...]:
        """Phases, and `all` where there are several."""
        names = tuple(phase.name for phase in TASKS[self.task].schedule.phases)
        return (*names, "all") if len(names) > 1 else names

    @property
    def printed(self) -> Errors:
        """Errors with all faults: the printed voltages."""
        return self.resultss[frozenset(self.causes)]

    def waterfall(self, phase: str) -> list[float]:
        """RMSE with all faults, then after each is taken away in order, shape (causes + 1,)."""
        left = [frozenset(self.causes[k:]) for k in range(len(self.causes) + 1)]
        return [self.resultss[faults][phase] for faults in left]

    def alone(self, cause: str, phase: str) -> float:
        """RMSE with all faults but one."""
        return self.resultss[frozenset(self.causes) - {cause}][phase]

    def share(self, cause: str, phase: str) -> float:
        """Return a fault's share of the mean square (mm^2 or deg^2), averaged over all orders.

        Shapley's value: shares add up to the difference of the mean squares with all faults and
        with none, and depend on no order. Negative where a fault makes up for others.
        """
        others = [other for other in self.causes if other != cause]
        count, total = len(self.causes), 0.0
        for size in range(count):
            weight = 1.0 / (count * math.comb(count - 1, size))
            for some in itertools.combinations(others, size):
                without = self.resultss[frozenset(some)][phase]
                total += weight * (
                    self.resultss[frozenset({*some, cause})][phase] ** 2 - without**2
                )
        return total


def trial_budget(task: str, pressure_kpa: float, model: Model | str = "station") -> Budget:
    """The budget of a trial of the dissertation.

    Args:
        task: `displacement` or `rotation`.
        pressure_kpa: a pressure that it was done at (kPa).
        model: of a station.
    """
    plant = Plant(load_model(model))
    station = StationInfo(plant.model, TASKS[task], 1e3 * pressure_kpa, PERIOD_S)
    open_loop, causes = OpenLoop(plant, station), causes_of(task)
    sets = [frozenset(some) for some in _subsets(causes)]
    volts = [open_loop.voltages(faults) for faults in sets]
    errors = simulated_errors([plant] * len(sets), station, volts)
    return Budget(
        task,
        pressure_kpa,
        causes,
        dict(zip(sets, errors, strict=True)),
        simulated_errors([plant], station, [open_loop.improved])[0],
        _variants(open_loop),
        _measured(task, pressure_kpa),
    )


def simulated_errors(
    plants: Sequence[Plant], station: StationInfo, volts: Sequence[NDArray[np.float64]]
) -> list[Errors]:
    """RMSE (mm or deg) by phase of open-loop trials, one for each plant and its voltages."""
    unit, results = SI_FACTORS[station.task.schedule.unit], []
    for k in range(0, len(volts), AT_ONCE):
        part = slice(k, k + AT_ONCE)
        for position in open_loop_positions(plants[part], station, volts[part]):
            errors = phase_rmse(station.task.schedule, position)
            results.append({name: value / unit for name, value in errors.items()})
    return results


def _variants(open_loop: OpenLoop) -> dict[str, Errors]:
    """The printed voltages held instead of joined, computed without lag, and on other stations."""
    station, plant = open_loop.station, open_loop.plant
    faults = frozenset(causes_of(station.task.name))
    printed = open_loop.voltages(faults)
    others = {name: Plant(without(plant.model, part)) for name, part in WITHOUT.items()}
    cases = {
        "samples held": (plant, open_loop.voltages(faults, interpolation="zoh")),
        "no lag compensation": (plant, open_loop.voltages(faults - {"chatter"}, compensated=False)),
        **{name: (other, printed) for name, other in others.items()},
    }
    plants, volts = zip(*cases.values(), strict=True)
    return dict(zip(cases, simulated_errors(plants, station, volts), strict=True))


def _measured(task: str, pressure_kpa: float) -> Errors:
    """The dissertation's RMSE (mm or deg) by phase."""
    schedule = TASKS[task].schedule
    errors = {
        phase.name: measured_score(task, phase.name, pressure_kpa).rmse for phase in schedule.phases
    }
    return errors | {"all": math.sqrt(np.mean(np.square(list(errors.values()))))}


def _subsets(causes: Iterable[str]) -> Iterable[tuple[str, ...]]:
    every = list(causes)
    return itertools.chain.from_iterable(
        itertools.combinations(every, size) for size in range(len(every) + 1)
    )
