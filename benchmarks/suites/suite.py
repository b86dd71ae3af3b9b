"""Frozen suites: stations, episodes on them, compared controllers."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.suites.stations import DrawnStation, Recipe, draw_station
from controllers.design import designs
from pma_gym.plant.model import Model, load_model
from pma_gym.tasks import named_task

FIGURES = {
    "largest": "largest mean error of a controller at any pressure (mm or deg)",
    "above_bound": "the same, above the achievable bound (mm or deg)",
    "best": "least interquartile mean of any controller (mm or deg)",
    "best_to_bound": "the best controller's interquartile mean over the oracle's",
    "to_bound": "a controller's interquartile mean over the oracle's",
    "to_other": "the first controller's interquartile mean over the second's",
    "half_width": "widest half interval of an interquartile mean (% of it)",
    "ratio_half_width": "widest half interval of a ratio to the best, up to twice it (% of it)",
}
"""Figures that a target may speak of."""

PER_CONTROLLER = ("largest", "above_bound", "to_bound", "to_other")
"""Figures of the controllers that the target names; the others are of all rivals."""


class Target(NamedTuple):
    """A figure and the most that it may be.

    Attributes:
        figure: one of `FIGURES`.
        measure: name of the measure, see `benchmarks.report.errors.measures`.
        most: limit, in the figure's unit; None for a figure that is only told.
        controllers: names of those that it speaks of.
    """

    figure: str
    measure: str
    most: float | None
    controllers: tuple[str, ...] = ()


def parse_target(table: Mapping[str, Any]) -> Target:
    """A target from a suite's file, its table `[[targets]]`.

    Raises:
        ValueError: an unknown figure or key, or controllers where none or some are needed.
    """
    unknown = set(table) - set(Target._fields)
    if unknown:
        raise ValueError(f"targets: unknown {', '.join(sorted(unknown))}; known: {Target._fields}")
    figure, controllers = table["figure"], tuple(table.get("controllers", ()))
    if figure not in FIGURES:
        raise ValueError(f"targets: figure must be one of {', '.join(FIGURES)}, got {figure!r}")
    if bool(controllers) != (figure in PER_CONTROLLER):
        rule = "must name" if figure in PER_CONTROLLER else "speaks of all and must not name"
        raise ValueError(f"targets: {figure} {rule} controllers, got {list(controllers)}")
    if figure == "to_other" and len(controllers) != 2:
        raise ValueError(f"targets: to_other compares two controllers, got {list(controllers)}")
    most = table.get("most")
    return Target(figure, table["measure"], None if most is None else float(most), controllers)


SUITES = Path(__file__).parent

JOINT = "joint"
"""Name of the suite of other rigs than the station, see `benchmarks.rigs.suite`."""


class SuiteError(ValueError):
    """A suite or a selection that cannot be; the message says what there is."""


NOMINAL = -1
"""Number of the station that is as its model."""


class Episode(NamedTuple):
    """Episode on a station: a task at a pressure, with separate noise.

    Attributes:
        station: number of the station; `NOMINAL` for the one that is as its model.
        task: name of the task.
        pressure_kpa: gauge pressure (kPa).
        repeat: which of the episodes that differ in their noise alone.
    """

    station: int
    task: str
    pressure_kpa: float
    repeat: int

    @property
    def name(self) -> str:
        """Unique name: `17/rotation/300/0`."""
        return f"{self.station}/{self.task}/{self.pressure_kpa:g}/{self.repeat}"


class EpisodePlan(NamedTuple):
    """Trials that are dealt to the stations in turn, so that each comes equally often.

    Attributes:
        tasks: names of the tasks.
        pressures_kpa: pressures of each of them (kPa).
        per_station: how many trials a station gets; all of them if 0.
        repeats: episodes of each, with noise of their own.
    """

    tasks: tuple[str, ...]
    pressures_kpa: tuple[float, ...]
    per_station: int = 0
    repeats: int = 1

    def trials(self, number: int) -> list[tuple[str, float]]:
        """Task and pressure (kPa) of what the station of a number gets, evenly spread.

        >>> EpisodePlan(("rotation",), (275, 300, 350, 400), per_station=2).trials(1)
        [('rotation', 300), ('rotation', 400)]
        """
        deck = [(task, pressure) for task in self.tasks for pressure in self.pressures_kpa]
        taken = self.per_station or len(deck)
        chosen = {(number + round(k * len(deck) / taken)) % len(deck) for k in range(taken)}
        return [deck[at] for at in sorted(chosen)]


class Entry(NamedTuple):
    """A controller of a suite.

    Attributes:
        spec: who.
        only: tasks that it can do; all if empty.
        models: models that it runs on, where a suite has several; all if empty.
    """

    spec: ControllerSpec
    only: tuple[str, ...] = ()
    models: tuple[str, ...] = ()

    def does(self, task: str) -> bool:
        """Return whether it can do a task."""
        return not self.only or task in self.only


@dataclass(frozen=True, eq=False)
class FrozenSuite:
    """Stations, episodes on them, and who is compared.

    Attributes:
        source: name of the suite, or path of its file, by which it is loaded again.
        name: what results call it.
        title: one line for people.
        version: changes whenever a number does.
        seed: every episode's seed is derived from it.
        model: name of the model that controllers receive.
        environment: keyword arguments of the environments.
        stations: numbers of the stations, in order.
        recipe: how stations are drawn; None if only the nominal one is there.
        episode_plans: which trials they get.
        entries: who is compared, in the order of the tables.
        targets: what is asked of them.
        digest: of all numbers, controllers and targets apart.
        only_by_name: whether it is so long that it runs only where it is named.
        only_tasks: tasks that are run; all if empty.
    """

    source: str
    name: str
    title: str
    version: int
    seed: int
    model: str
    environment: Mapping[str, Any]
    stations: tuple[int, ...]
    recipe: Recipe | None
    episode_plans: tuple[EpisodePlan, ...]
    entries: tuple[Entry, ...]
    targets: tuple[Target, ...]
    digest: str
    only_by_name: bool = False
    only_tasks: tuple[str, ...] = ()

    keep_pace: ClassVar[bool] = True
    """Whether a controller from a file must on average answer within a control period."""
    has_lines: ClassVar[bool] = False
    """Whether rows have the regression line of every phase too."""

    @cached_property
    def episodes(self) -> tuple[Episode, ...]:
        """Every episode, station by station."""
        return tuple(
            Episode(station, task, pressure, repeat)
            for at, station in enumerate(self.stations)
            for plan in self.episode_plans
            for task, pressure in plan.trials(at)
            for repeat in range(plan.repeats)
            if task in self.tasks
        )

    def part(self, stations: int | None = None, tasks: Sequence[str] = ()) -> "FrozenSuite":
        """Its first stations and some tasks, for a quick look: the very episodes of the whole.

        Raises:
            SuiteError: so many stations or such a task it does not have.
        """
        if stations is not None and stations > len(self.stations):
            raise SuiteError(
                f"suite {self.name} has {len(self.stations)} stations, got --stations {stations}"
            )
        for task in tasks:
            if task not in self.tasks:
                raise SuiteError(
                    f"suite {self.name} has the tasks {', '.join(self.tasks)}, got --task {task}"
                )
        return replace(self, stations=self.stations[:stations], only_tasks=tuple(tasks))

    @property
    def control_rate_hz(self) -> float:
        """Control steps a second (Hz)."""
        return float(self.environment["control_rate_hz"])

    @property
    def tasks(self) -> tuple[str, ...]:
        """Names of its tasks."""
        every = dict.fromkeys(task for plan in self.episode_plans for task in plan.tasks)
        return tuple(task for task in every if task in self.only_tasks or not self.only_tasks)

    def runs(self, entry: Entry, episode: Episode) -> bool:
        """Return whether a controller of the suite runs an episode."""
        return entry.does(episode.task)

    def seed_of(self, episode: Episode, controller: str = "") -> int:
        """An episode's seed, the same for every controller: they are compared under one noise."""
        digest = hashlib.sha256(f"{self.seed}:{episode.name}".encode()).digest()
        return int.from_bytes(digest[:4], "big")

    def station(self, number: int) -> DrawnStation:
        """A station by its number."""
        if number == NOMINAL:
            return DrawnStation(self.nominal, (), ())
        assert self.recipe is not None
        return _station(self.recipe, number)

    @cached_property
    def nominal(self) -> Model:
        """The model that controllers receive."""
        return load_model(self.model)

    def nominal_of(self, number: int) -> Model:
        """The model that controllers receive on a station."""
        return self.nominal

    def case_name(self, episode: Episode, controller: str) -> str:
        """Return a case's unique name: `pid/17/rotation/300/0`."""
        return f"{controller}/{episode.name}"

    def entry(self, spec: ControllerSpec) -> Entry:
        """Return the suite's entry of a controller, or a new one for another controller.

        Raises:
            SuiteError: none of the suite's tasks is of a kind that the controller can do.
        """
        for entry in self.entries:
            if entry.spec.source == spec.source:
                return entry
        kinds = spec.kinds
        able = tuple(task for task in self.tasks if kind_of(task) in kinds)
        if kinds and not able:
            there = sorted({kind_of(task) for task in self.tasks})
            raise SuiteError(
                f"{spec.name} does {', '.join(sorted(kinds))} alone, and suite {self.name} "
                f"has {', '.join(there)}; name another controller, or another suite"
            )
        return Entry(spec, able)


def kind_of(task: str) -> str:
    """Kind of a task of a suite."""
    known = named_task(task)
    assert known is not None
    return designs.kind_of(known)


@lru_cache(maxsize=4096)
def _station(recipe: Recipe, number: int) -> DrawnStation:
    return draw_station(recipe, number)
