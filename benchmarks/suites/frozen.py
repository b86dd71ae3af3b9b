"""Frozen suites: what is run on which stations, read from a file that pins every number."""

import difflib
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.suites.recipe import Recipe, parse_recipe
from benchmarks.suites.reproduction import SUITES, SuiteError
from benchmarks.suites.stations import DrawnStation, draw_station
from benchmarks.suites.target import Target, parse_target
from controllers.design import designs
from pma_gym.document_shape import ListOf, Maybe, Real, Whole, check_shape
from pma_gym.documents import DocumentError, is_file, read_toml
from pma_gym.engine.options import parse_options
from pma_gym.limits import LimitError
from pma_gym.plant.model import Model, is_path, load_model, missing_file
from pma_gym.tasks import EVERY_TASK, named_task

SCHEMA = 2
"""Of the files of suites that compare controllers; `reproduction.toml` has schema 1."""

UNFROZEN = ("title", "controllers", "targets", "only_by_name")
"""Entries of a suite's file that move no figure: they may change without a new version."""

MOST_EPISODES = 1_000_000
"""Most episodes of a suite."""

_TABLE_OF_NUMBERS = {"*": ListOf(Real(), 1)}
_STATIONS = {
    "seed": Whole(0),
    "training_seed": Whole(0),
    "widening": Real(0),
    "variation": Real(0),
    "reach_v": Real(0),
    "trials": _TABLE_OF_NUMBERS,
    "effects?": ListOf(
        {
            "name": str,
            "share": Real(0, 1),
            "ranges": _TABLE_OF_NUMBERS,
            "tied?": {"*": {"to": str, "factor": Real()}},
        }
    ),
}
"""Shape of a recipe of stations."""

_SHAPE = {
    "name": str,
    "title": str,
    "version": Whole(0),
    "seed": Whole(0),
    "model": str,
    "environment": {"control_rate_hz": Real()},
    "stations?": {"count?": Whole(0, MOST_EPISODES), "nominal?": bool, "of?": str},
    "episodes": ListOf(
        {
            "tasks": ListOf(str, 1),
            "pressures_kpa": ListOf(Real(), 1),
            "per_station?": Whole(0, MOST_EPISODES),
            "repeats?": Whole(1, MOST_EPISODES),
        },
        1,
    ),
    "controllers": ListOf({"name": str, "title": str, "only?": ListOf(str)}),
    "targets?": ListOf(
        {"figure": str, "measure": str, "most?": Maybe(Real()), "controllers?": ListOf(str)}
    ),
    "only_by_name?": bool,
}
"""Shape of a suite's file."""

_LINE_FORM = "a line is a table, [stations], or name = value; see benchmarks/suites/robust.toml"

NOMINAL = -1
"""Number of the station that is as its model."""


class Episode(NamedTuple):
    """What happens on a station: a task at a pressure, with noise of its own.

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
        """What tells it from the others: `17/rotation/300/0`."""
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

        >>> Deal(("rotation",), (275, 300, 350, 400), per_station=2).trials(1)
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
    """

    spec: ControllerSpec
    only: tuple[str, ...] = ()

    def does(self, task: str) -> bool:
        """Whether it can do a task."""
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

    @cached_property
    def episodes(self) -> tuple[Episode, ...]:
        """Every episode, station by station."""
        return tuple(
            Episode(station, task, pressure, repeat)
            for at, station in enumerate(self.stations)
            for plan in self.episode_plans
            for task, pressure in plan.trials(at)
            for repeat in range(plan.repeats)
        )

    @property
    def control_rate_hz(self) -> float:
        """Control steps a second (Hz)."""
        return float(self.environment["control_rate_hz"])

    @property
    def tasks(self) -> tuple[str, ...]:
        """Names of its tasks."""
        return tuple(dict.fromkeys(task for plan in self.episode_plans for task in plan.tasks))

    def seed_of(self, episode: Episode) -> int:
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

    def entry(self, spec: ControllerSpec) -> Entry:
        """The suite's entry of a controller; one of its own for a controller it does not have.

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


def suite_names() -> list[str]:
    """Names of the frozen suites that come with the benchmark."""
    return [path.stem for path in sorted(SUITES.glob("*.toml")) if _schema(path) == SCHEMA]


def _schema(path: Path) -> object:
    return read_toml(path).get("schema")


@lru_cache(maxsize=16)
def frozen_suite(source: str) -> FrozenSuite:
    """A suite by its name, or from a file of one's own.

    Raises:
        SuiteError: there is none, or its file is not as it should be; names the file and the fix.
    """
    path = Path(source) if is_path(source) else SUITES / f"{source}.toml"
    if is_path(source) and missing_file(path):
        raise SuiteError(missing_file(path))
    if not is_file(path):
        near = difflib.get_close_matches(source, suite_names(), 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise SuiteError(
            f"no suite {source!r}: there are {', '.join(suite_names())}, or give the path of a "
            f".toml file{hint}"
        )
    try:
        return parse_suite(source, read_toml(path, _LINE_FORM))
    except (DocumentError, LimitError) as error:
        raise SuiteError(str(error)) from error
    except RecursionError:
        raise SuiteError(f"{path}: stations.of leads back to this file; name another") from None
    except KeyError as error:
        raise SuiteError(f"{path} lacks {error.args[0]}; see {SUITES}/robust.toml") from error
    except (TypeError, ValueError) as error:
        raise SuiteError(f"{path}: {error}") from error


def parse_suite(source: str, document: Mapping[str, Any]) -> FrozenSuite:
    """A suite from its parsed file.

    Raises:
        ValueError: what is missing or wrong.
    """
    if document.get("schema") != SCHEMA:
        raise SuiteError(f"schema must be {SCHEMA}, got {document.get('schema')!r}")
    check_shape(document, _SHAPE)
    stations = dict(document.get("stations", {}))
    numbers = tuple(range(int(stations.get("count", 0))))
    if not numbers or stations.get("nominal", False):
        numbers = (NOMINAL, *numbers)
    episode_plans = tuple(_episode_plan(entry) for entry in document["episodes"])
    episodes = len(numbers) * sum(
        plan.repeats * (plan.per_station or len(plan.tasks) * len(plan.pressures_kpa))
        for plan in episode_plans
    )
    if episodes > MOST_EPISODES:
        raise ValueError(
            f"a suite must have at most {MOST_EPISODES} episodes, got {episodes}; lower "
            "stations.count, per_station or repeats"
        )
    frozen = {key: value for key, value in document.items() if key not in UNFROZEN}
    if "of" in stations:
        frozen["of"] = frozen_suite(stations["of"]).digest
    parse_options(document["environment"])
    return FrozenSuite(
        source=source,
        name=document["name"],
        title=document["title"],
        version=document["version"],
        seed=document["seed"],
        model=document["model"],
        environment=dict(document["environment"]),
        stations=numbers,
        recipe=_recipe(stations, document["model"]),
        episode_plans=episode_plans,
        entries=tuple(_entry(entry) for entry in document["controllers"]),
        targets=tuple(parse_target(given) for given in document.get("targets", ())),
        digest=_digest(json.dumps(frozen, sort_keys=True)),
        only_by_name=document.get("only_by_name", False),
    )


def _recipe(stations: Mapping[str, Any], model: str) -> Recipe | None:
    """The recipe of a suite's stations: its own, or another suite's, whose stations they are."""
    if not stations:
        return None
    if "of" not in stations:
        check_shape(stations, _STATIONS, "stations")
        return parse_recipe(stations, model)
    other = frozen_suite(stations["of"])
    if other.recipe is None or other.model != model:
        raise ValueError(f"stations.of: suite {other.name} draws no stations about {model}")
    return other.recipe


def _episode_plan(given: Mapping[str, Any]) -> EpisodePlan:
    unknown = [task for task in given["tasks"] if named_task(task) is None]
    if unknown:
        raise ValueError(f"unknown tasks: {', '.join(unknown)}; known: {', '.join(EVERY_TASK)}")
    return EpisodePlan(
        tasks=tuple(given["tasks"]),
        pressures_kpa=tuple(given["pressures_kpa"]),
        per_station=given.get("per_station", 0),
        repeats=given.get("repeats", 1),
    )


def _entry(given: Mapping[str, Any]) -> Entry:
    return Entry(ControllerSpec(given["name"], given["title"]), tuple(given.get("only", ())))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]
