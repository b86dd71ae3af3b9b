"""Reads frozen suites from files that pin every number."""

import copyreg
import difflib
import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.suites.reproduction import GOAL_FIGURES, Goals, ReproductionSuite
from benchmarks.suites.stations import Recipe, parse_recipe
from benchmarks.suites.suite import (
    JOINT,
    NOMINAL,
    SUITES,
    Entry,
    EpisodePlan,
    FrozenSuite,
    SuiteError,
    parse_target,
)
from pma_gym.document_shape import ListOf, Maybe, Real, Whole, check_shape
from pma_gym.documents import DocumentError, is_file, read_toml
from pma_gym.engine.options import parse_options
from pma_gym.files import is_path, missing_file
from pma_gym.limits import LimitError
from pma_gym.tasks import EVERY_TASK, named_task

SCHEMA = 2
"""Of the files."""

UNFROZEN = ("title", "controllers", "targets", "only_by_name", "reproduction")
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
    "controllers": ListOf(
        {"name": str, "title": str, "only?": ListOf(str), "models?": ListOf(str)}
    ),
    "targets?": ListOf(
        {"figure": str, "measure": str, "most?": Maybe(Real()), "controllers?": ListOf(str)}
    ),
    "only_by_name?": bool,
    "reproduction?": {
        "models": ListOf(str, 1),
        "pictured_kpa": _TABLE_OF_NUMBERS,
        "goals": {
            "replay": str,
            "feedback": ListOf(str),
            "simple_prediction": {"slope": Real(), "intercept": Real(), "rmse": Real()},
            **{name: Real() for name in GOAL_FIGURES},
        },
    },
}
"""Shape of a suite's file."""

_LINE_FORM = "a line is a table, [stations], or name = value; see benchmarks/suites/robust.toml"


def suite_names() -> list[str]:
    """Names of the frozen suites that come with the benchmark."""
    return [path.stem for path in sorted(SUITES.glob("*.toml"))]


@lru_cache(maxsize=16)
def frozen_suite(source: str) -> FrozenSuite:
    """A suite by its name, or from a file of one's own.

    Raises:
        SuiteError: there is none, or its file is not as it should be; names the file and the fix.
    """
    if source == JOINT:
        raise SuiteError(
            f"suite {JOINT} is of other rigs than the station: only `python -m benchmarks run "
            f"--suite {JOINT}` takes it, and writes its report"
        )
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
    environment = document["environment"]
    parse_options(environment)
    common: dict[str, Any] = {
        "source": source,
        "name": document["name"],
        "title": document["title"],
        "version": document["version"],
        "seed": document["seed"],
        "model": document["model"],
        "environment": environment,
        "stations": numbers,
        "recipe": _recipe(stations, document["model"]),
        "episode_plans": episode_plans,
        "entries": tuple(_entry(entry) for entry in document["controllers"]),
        "targets": tuple(parse_target(table) for table in document.get("targets", ())),
        "digest": _digest(document),
        "only_by_name": document.get("only_by_name", False),
    }
    if "reproduction" in document:
        return _reproduction(document["reproduction"], common)
    return FrozenSuite(**common)


def load_suite(name: str = "reproduction") -> ReproductionSuite:
    """The suite of the reproduction.

    >>> suite = load_suite()
    >>> suite.models, len(suite.episodes)
    (('station', 'cascade'), 34)
    """
    suite = frozen_suite(name)
    assert isinstance(suite, ReproductionSuite)
    return suite


def _reproduction(table: Mapping[str, Any], common: Mapping[str, Any]) -> ReproductionSuite:
    """A suite on several models, with the report of the reproduction.

    Args:
        table: the file's `[reproduction]`.
        common: what any suite has.
    """
    goals = table["goals"] | {"feedback": tuple(table["goals"]["feedback"])}
    suite = ReproductionSuite(
        **common,
        frozen_digest=common["digest"],
        models=(common["model"],),
        pictured_kpa={task: tuple(kpa) for task, kpa in table["pictured_kpa"].items()},
        goals=Goals(**goals),
    )
    return suite.on(table["models"])


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


def _episode_plan(table: Mapping[str, Any]) -> EpisodePlan:
    unknown = [task for task in table["tasks"] if named_task(task) is None]
    if unknown:
        raise ValueError(f"unknown tasks: {', '.join(unknown)}; known: {', '.join(EVERY_TASK)}")
    return EpisodePlan(
        tasks=tuple(table["tasks"]),
        pressures_kpa=tuple(table["pressures_kpa"]),
        per_station=table.get("per_station", 0),
        repeats=table.get("repeats", 1),
    )


def _entry(table: Mapping[str, Any]) -> Entry:
    spec = ControllerSpec(table["name"], table["title"])
    return Entry(spec, tuple(table.get("only", ())), tuple(table.get("models", ())))


def _digest(document: Mapping[str, Any]) -> str:
    """Digest of all that moves a figure."""
    frozen = {key: value for key, value in document.items() if key not in UNFROZEN}
    if "of" in document.get("stations", {}):
        frozen["of"] = frozen_suite(document["stations"]["of"]).digest
    return hashlib.sha256(json.dumps(frozen, sort_keys=True).encode()).hexdigest()[:16]


def _unpacked(source: str, models: tuple[str, ...]) -> FrozenSuite:
    suite = frozen_suite(source)
    return suite.on(models) if models and isinstance(suite, ReproductionSuite) else suite


def _packed(suite: ReproductionSuite) -> tuple[Any, ...]:
    """By source and models: controllers and trials come with each case."""
    return _unpacked, (suite.source, tuple(suite.models))


copyreg.pickle(ReproductionSuite, _packed)
