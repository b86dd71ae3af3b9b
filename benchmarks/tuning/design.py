"""Designs the controllers that have settings: searches them on training stations.

For every controller with settings, loop and kind of task:

1. Start: the best of the defaults of the controller's file and of `SCATTERED` points of a Latin
   hypercube in the logarithms of the settings that the file bounds (`BOUNDS`).
2. Search: Nelder-Mead from there, in the same logarithms. The cost
   of settings is the mean, over `STATIONS` training stations of the suite that has this loop, of
   what a trial with its noise, delays and disturbances costs:

       mean over the phases of RMSE / target + 0.01 s/V * total variation of the voltage / duration

   as in `benchmarks.tuning.tune`, with a target of 0.3 mm in contraction tasks. A trial that fails
   costs `FAILED`.

Training stations are drawn with a seed of their own: no suite scores them. The same seed gives the
same settings on the same machine and versions. Every search that ends is written at once; the same
command goes on with those that are missing. Single designs are made anew by `--again` with
`--controllers lqg,mpc`, `--only 'hard/*'` or both; all others stay as they are.
"""

import difflib
import inspect
import json
import math
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress
from scipy.optimize import minimize
from scipy.stats.qmc import LatinHypercube, scale

from benchmarks.executors.choice import local
from benchmarks.executors.executor import run_all
from benchmarks.files import write_text
from benchmarks.runner.rollout import Rollout, rollout
from benchmarks.suites.frozen import FrozenSuite, frozen_suite
from benchmarks.suites.stations import draw_station
from benchmarks.tuning.choice import chosen
from benchmarks.tuning.cost import TARGETS, VARIATION_WEIGHT_S_PER_V
from benchmarks.tuning.tune import CONTROLLERS as TUNED
from controllers import CONTROLLERS
from controllers.design.designs import KINDS, SCHEMA, loop_name
from pma_gym.document_shape import check_shape
from pma_gym.documents import read_json
from pma_gym.envs import PMAEnv
from pma_gym.metrics import rmse
from pma_gym.plant.model import Model
from pma_gym.tasks import phase_errors
from pma_gym.terminal import SafeConsole

SUITES = ("robust", "hard", "pressure")
"""Suites whose loops and tasks controllers are designed for; on other stations than theirs."""

STATIONS = 8
SCATTERED = 12
EVALUATIONS = 28
FAILED = 100.0
CONTRACTION_TARGET = 0.3e-3
"""What an RMSE (m) is counted against in contraction tasks: three times that of displacement, the
regulator being slower than the motor by about that much. An assumption."""

DIGITS = 3


class DesignError(ValueError):
    """A controller that cannot be designed; the message says why."""


@dataclass(frozen=True)
class Search:
    """One search: settings of a controller for the tasks of a kind in a suite's loop.

    Attributes:
        controller: its name.
        suite: name of the suite.
        kind: `displacement`, `rotation` or `contraction`.
        seed: of the noise.
    """

    controller: str
    suite: str
    kind: str
    seed: int

    @property
    def name(self) -> str:
        """What tells it from the others."""
        return f"{self.controller}/{self.table}"

    @property
    def table(self) -> str:
        """Suite and kind of task, as `only` names them: `hard/rotation`."""
        return f"{self.suite}/{self.kind}"


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes:
        values: settings by name.
        cost: their cost.
        first_cost: that of the defaults.
        loop: name of the loop.
    """

    values: Mapping[str, float]
    cost: float
    first_cost: float
    loop: str


@dataclass(frozen=True, eq=False)
class _Drill:
    """A trial on a training station."""

    task: str
    pressure_kpa: float
    model: Model
    seed: int


def run_design(
    controllers: list[str], out: Path, seed: int, jobs: int, again: bool, only: str = "*"
) -> bool:
    """Search the settings of controllers and write them; those of others stay.

    Args:
        controllers: names; all that have settings if empty.
        out: file of settings.
        seed: of the noise.
        jobs: processes.
        again: also what the file has already.
        only: which designs, by suite and kind of task: patterns such as `hard/*` by commas.
    Returns:
        Whether all of it was done; Ctrl-C leaves what is done in the file.
    Raises:
        ValueError: a pattern matches nothing.
        DesignError: a controller without settings, a broken file, or a search that failed.
    """
    document = _read(out)
    asked = searches_of(controllers or designable(), seed, only)
    searches = [s for s in asked if again or s.name not in document["provenance"]]
    if len(searches) < len(asked):
        there = len(asked) - len(searches)
        print(f"{out} has {there} of {len(asked)} designs asked for; --again makes them anew")
    with Progress(console=SafeConsole()) as progress:
        bar = progress.add_task("Designing", total=len(searches))

        def keep(index: int, result: object) -> None:
            search = searches[index]
            if isinstance(result, BaseException):
                raise DesignError(f"{search.name}: {type(result).__name__}: {result}") from result
            assert isinstance(result, Found)
            _write(out, document, search, result)
            progress.update(bar, advance=1)
            progress.console.print(
                f"{search.name}: cost {result.first_cost:.3f} -> {result.cost:.3f}, {result.values}"
            )

        complete = run_all([partial(design, search) for search in searches], local(jobs), keep)
    if not complete:
        print(f"Interrupted; {out} has what is done, run again to go on.", file=sys.stderr)
    return complete


def designable() -> list[str]:
    """Names of the controllers that have settings to search."""
    return [name for name in CONTROLLERS if _bounds(name)]


def _bounds(controller: str) -> Mapping[str, tuple[float, float]]:
    return getattr(inspect.getmodule(CONTROLLERS[controller]), "BOUNDS", {})


def searches_of(controllers: Iterable[str], seed: int, only: str = "*") -> list[Search]:
    """The searches of controllers, each once, in the suites and kinds of task that patterns match.

    Raises:
        ValueError: a pattern matches nothing.
        DesignError: a controller that has no settings, or that there is not.
    """
    names = list(dict.fromkeys(controllers))
    for name in names:
        _check_designable(name)
    found = [search for name in names for search in _searches(name, seed)]
    wanted = chosen((search.table for search in found), only)
    return [search for search in found if search.table in wanted]


def _check_designable(controller: str) -> None:
    known = designable()
    if controller in known:
        return
    near = difflib.get_close_matches(controller, known, 1)
    mend = f"; did you mean {near[0]}?" if near else ""
    if controller in TUNED:
        mend = "; its gains are tuned: python -m benchmarks tune"
    raise DesignError(
        f"controllers must have settings to search, got {controller!r}; there are "
        f"{', '.join(known)}{mend}"
    )


def _searches(controller: str, seed: int) -> Iterator[Search]:
    for suite in SUITES:
        quantities = {_task_quantity(name) for name in frozen_suite(suite).tasks}
        for kind in sorted(KINDS[quantity] for quantity in quantities):
            yield Search(controller, suite, kind, seed)


def _task_quantity(task: str) -> str:
    return PMAEnv(task=task, pressure_kpa=300.0).task.protocol.quantity


def design(search: Search) -> Found:
    """The settings of least cost that a search finds."""
    factory: Any = CONTROLLERS[search.controller]
    bounds = _bounds(search.controller)
    drills = _drills(search)
    start = inspect.getmodule(factory).DEFAULTS[search.kind]  # type: ignore[union-attr]
    names = list(bounds)

    def settings(logs: np.ndarray) -> Any:  # noqa: ANN401
        values = {n: float(f"{math.exp(x):.{DIGITS}g}") for n, x in zip(names, logs, strict=True)}
        return start._replace(**values)

    def cost(logs: np.ndarray) -> float:
        return mean_cost(factory, settings(logs), drills, search.suite)

    limits = np.log([bounds[name] for name in names])
    first = np.log([getattr(start, name) for name in names])
    scattered = LatinHypercube(len(names), rng=np.random.default_rng(search.seed))
    points = [first, *scale(scattered.random(SCATTERED), limits[:, 0], limits[:, 1])]
    costs = [cost(point) for point in points]
    nearest = points[int(np.argmin(costs))]
    simplex = np.vstack(
        [nearest, nearest + 0.5 * np.diag(np.where(nearest < limits.mean(1), 1, -1))]
    )
    found = minimize(
        cost,
        nearest,
        method="Nelder-Mead",
        bounds=limits,
        options={"maxfev": EVALUATIONS, "initial_simplex": simplex},
    )
    best, least = (settings(found.x), float(found.fun))
    if costs[0] <= least:
        best, least = start, costs[0]
    station = _environment(search.suite, drills[0]).station
    values = {name: getattr(best, name) for name in names}
    return Found(values, least, costs[0], loop_name(station))


def mean_cost(factory: Any, settings: Any, drills: list[_Drill], suite: str) -> float:  # noqa: ANN401
    """Mean cost of settings over trials."""
    nominal = frozen_suite(suite).nominal
    costs = []
    for drill in drills:
        environment = _environment(suite, drill)
        try:
            done = rollout(environment, factory(settings), drill.seed, nominal)
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            costs.append(FAILED)
            continue
        costs.append(min(trial_cost(done), FAILED))
    return float(np.mean(costs))


def trial_cost(done: Rollout) -> float:
    """What a trial costs; `FAILED` if a physical limit ended it."""
    if done.ended_by:
        return FAILED
    protocol = done.task.protocol
    target = (TARGETS | {"contraction": CONTRACTION_TARGET})[protocol.quantity]
    errors = phase_errors(protocol, done.position).values()
    actuator = 1 if done.task.actuator == "regulator" else 0
    variation = float(np.abs(np.diff(done.commands[:, actuator])).sum())
    return float(np.mean([rmse(error) for error in errors])) / target + (
        VARIATION_WEIGHT_S_PER_V * variation / (done.steps * done.period)
    )


@lru_cache(maxsize=64)
def _environment(suite: str, drill: _Drill) -> PMAEnv:
    return PMAEnv(
        task=drill.task,
        model=drill.model,
        pressure_kpa=drill.pressure_kpa,
        **frozen_suite(suite).environment,
    )


def _drills(search: Search) -> list[_Drill]:
    """Trials of a kind on training stations: pressures and tasks of the suite in turn."""
    suite = frozen_suite(search.suite)
    deck = [
        (task, pressure)
        for deal in suite.deals
        for task in deal.tasks
        for pressure in deal.pressures_kpa
        if KINDS[_task_quantity(task)] == search.kind
    ]
    step = max(1, len(deck) // STATIONS)
    return [
        _Drill(*deck[(number * step) % len(deck)], _training(suite, number), search.seed + number)
        for number in range(STATIONS)
    ]


@lru_cache(maxsize=64)
def _training(suite: FrozenSuite, number: int) -> Model:
    assert suite.recipe is not None
    return draw_station(replace(suite.recipe, seed=suite.recipe.training_seed), number).model


def _read(path: Path) -> dict[str, Any]:
    document = {"schema": SCHEMA, "controllers": {}, "provenance": {}}
    if path.exists():
        try:
            found = read_json(path)
            check_shape(found, {"controllers?": {"*": {"*": dict}}, "provenance?": dict})
            document |= found
        except (ValueError, TypeError) as error:
            raise DesignError(
                f"{path} is no file of settings ({error}); delete it or name another"
            ) from error
    if document["schema"] != SCHEMA:
        raise DesignError(f"{path} must have schema {SCHEMA}; delete it or name another")
    return document


def _write(out: Path, document: dict[str, Any], search: Search, found: Found) -> None:
    loops = document["controllers"].setdefault(search.controller, {})
    loops.setdefault(found.loop, {})[search.kind] = dict(found.values)
    document["provenance"][search.name] = {
        "written_by": "benchmarks/tuning/design.py",
        "suite_version": frozen_suite(search.suite).version,
        "training_seed": getattr(frozen_suite(search.suite).recipe, "training_seed", None),
        "seed": search.seed,
        "stations": STATIONS,
        "evaluations": 1 + SCATTERED + EVALUATIONS,
        "cost_of_defaults": round(found.first_cost, 4),
        "cost": round(found.cost, 4),
    }
    for part in ("controllers", "provenance"):
        document[part] = dict(sorted(document[part].items()))
    write_text(out, json.dumps(document, indent=2) + "\n")
