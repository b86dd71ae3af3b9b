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
command goes on with those that are missing. Single designs are made anew by `--recompute` with
`--controllers lqg,mpc`, `--only 'hard/*'` or both; all others stay as they are.
"""

import difflib
import inspect
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
from benchmarks.files import toml_document, write_text
from benchmarks.runner.rollout import Rollout, rollout
from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.stations import draw_station
from benchmarks.suites.suite import FrozenSuite
from benchmarks.tuning.cost import TARGETS, VARIATION_WEIGHT_S_PER_V, chosen
from benchmarks.tuning.tune import CONTROLLERS as TUNED
from controllers import CONTROLLERS
from controllers.design.designs import DESIGN_SCHEMA, KINDS, loop_name, read_settings
from pma_gym.document_shape import Real, check_shape
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

HEAD = "Settings by controller, loop and kind of task: python -m benchmarks design"


class DesignError(ValueError):
    """A controller that cannot be designed; the message says why."""


@dataclass(frozen=True)
class DesignProblem:
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
        """Unique name."""
        return f"{self.controller}/{self.table}"

    @property
    def table(self) -> str:
        """Suite and kind of task, as `only` names them: `hard/rotation`."""
        return f"{self.suite}/{self.kind}"


@dataclass(frozen=True)
class DesignResult:
    """Settings that a search ends with.

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
    controllers: list[str], out: Path, seed: int, jobs: int, recompute: bool, only: str = "*"
) -> bool:
    """Search the settings of controllers and write them; those of others stay.

    Args:
        controllers: names; all that have settings if empty.
        out: file of settings.
        seed: of the noise.
        jobs: processes.
        recompute: also what the file has already.
        only: which designs, by suite and kind of task: patterns such as `hard/*` by commas.
    Returns:
        Whether all of it was done; Ctrl-C leaves what is done in the file.
    Raises:
        ValueError: a pattern matches nothing.
        DesignError: a controller without settings, a broken file, or a search that failed.
    """
    document = _read(out)
    asked = problems_of(controllers or designable(), seed, only)
    problems = [s for s in asked if recompute or not _is_in(document, s)]
    if len(problems) < len(asked):
        there = len(asked) - len(problems)
        print(f"{out} has {there} of {len(asked)} designs asked for; --recompute makes them anew")
    with Progress(console=SafeConsole()) as progress:
        bar = progress.add_task("Designing", total=len(problems))

        def keep(index: int, result: object) -> None:
            problem = problems[index]
            if isinstance(result, BaseException):
                raise DesignError(f"{problem.name}: {type(result).__name__}: {result}") from result
            assert isinstance(result, DesignResult)
            _write(out, document, problem, result)
            progress.update(bar, advance=1)
            progress.console.print(
                f"{problem.name}: cost {result.first_cost:.3f} -> {result.cost:.3f}, "
                f"{result.values}"
            )

        complete = run_all([partial(design, problem) for problem in problems], local(jobs), keep)
    if not complete:
        print(f"Interrupted; {out} has what is done, run again to go on.", file=sys.stderr)
    return complete


def designable() -> list[str]:
    """Names of the controllers that have settings to search."""
    return [name for name in CONTROLLERS if _bounds(name)]


def _bounds(controller: str) -> Mapping[str, tuple[float, float]]:
    return getattr(inspect.getmodule(CONTROLLERS[controller]), "BOUNDS", {})


def problems_of(controllers: Iterable[str], seed: int, only: str = "*") -> list[DesignProblem]:
    """The searches of controllers, each once, in the suites and kinds of task that patterns match.

    Raises:
        ValueError: a pattern matches nothing.
        DesignError: a controller that has no settings, or that there is not.
    """
    names = list(dict.fromkeys(controllers))
    for name in names:
        _check_designable(name)
    problems = [problem for name in names for problem in _problems(name, seed)]
    tables = chosen((problem.table for problem in problems), only)
    return [problem for problem in problems if problem.table in tables]


def _check_designable(controller: str) -> None:
    known = designable()
    if controller in known:
        return
    near = difflib.get_close_matches(controller, known, 1)
    hint = f"; did you mean {near[0]}?" if near else ""
    if controller in TUNED:
        hint = "; its gains are tuned: python -m benchmarks tune"
    raise DesignError(
        f"controllers must have settings to search, got {controller!r}; there are "
        f"{', '.join(known)}{hint}"
    )


def _problems(controller: str, seed: int) -> Iterator[DesignProblem]:
    for suite in SUITES:
        quantities = {_task_quantity(name) for name in frozen_suite(suite).tasks}
        for kind in sorted(KINDS[quantity] for quantity in quantities):
            yield DesignProblem(controller, suite, kind, seed)


def _task_quantity(task: str) -> str:
    return PMAEnv(task=task, pressure_kpa=300.0).task.schedule.quantity


def design(problem: DesignProblem) -> DesignResult:
    """The settings of least cost that a search finds."""
    factory: Any = CONTROLLERS[problem.controller]
    bounds = _bounds(problem.controller)
    drills = _drills(problem)
    start = inspect.getmodule(factory).DEFAULTS[problem.kind]  # type: ignore[union-attr]
    names = list(bounds)

    def settings(logs: np.ndarray) -> Any:  # noqa: ANN401
        values = {n: float(f"{math.exp(x):.{DIGITS}g}") for n, x in zip(names, logs, strict=True)}
        return start._replace(**values)

    def cost(logs: np.ndarray) -> float:
        return mean_cost(factory, settings(logs), drills, problem.suite)

    limits = np.log([bounds[name] for name in names])
    first = np.log([getattr(start, name) for name in names])
    scattered = LatinHypercube(len(names), rng=np.random.default_rng(problem.seed))
    points = [first, *scale(scattered.random(SCATTERED), limits[:, 0], limits[:, 1])]
    costs = [cost(point) for point in points]
    nearest = points[int(np.argmin(costs))]
    simplex = np.vstack(
        [nearest, nearest + 0.5 * np.diag(np.where(nearest < limits.mean(1), 1, -1))]
    )
    minimum = minimize(
        cost,
        nearest,
        method="Nelder-Mead",
        bounds=limits,
        options={"maxfev": EVALUATIONS, "initial_simplex": simplex},
    )
    best, least = (settings(minimum.x), float(minimum.fun))
    if costs[0] <= least:
        best, least = start, costs[0]
    station = _environment(problem.suite, drills[0]).station
    values = {name: getattr(best, name) for name in names}
    return DesignResult(values, least, costs[0], loop_name(station))


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
    """Return the cost of a trial; `FAILED` if a physical limit ended it."""
    if done.ended_by:
        return FAILED
    schedule = done.task.schedule
    target = (TARGETS | {"contraction": CONTRACTION_TARGET})[schedule.quantity]
    errors = phase_errors(schedule, done.position).values()
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


def _drills(problem: DesignProblem) -> list[_Drill]:
    """Trials of a kind on training stations: pressures and tasks of the suite in turn."""
    suite = frozen_suite(problem.suite)
    deck = [
        (task, pressure)
        for plan in suite.episode_plans
        for task in plan.tasks
        for pressure in plan.pressures_kpa
        if KINDS[_task_quantity(task)] == problem.kind
    ]
    step = max(1, len(deck) // STATIONS)
    return [
        _Drill(*deck[(number * step) % len(deck)], _training(suite, number), problem.seed + number)
        for number in range(STATIONS)
    ]


@lru_cache(maxsize=64)
def _training(suite: FrozenSuite, number: int) -> Model:
    assert suite.recipe is not None
    return draw_station(replace(suite.recipe, seed=suite.recipe.training_seed), number).model


def _read(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    try:
        tables = read_settings(path, DESIGN_SCHEMA, "design")
        check_shape(tables, {"*": {"*": {"*": {"provenance": str, "*?": Real()}}}})
    except ValueError as error:
        raise DesignError(
            f"{path} is no file of settings ({error}); delete it or name another"
        ) from error
    return tables


def _is_in(document: Mapping[str, Any], problem: DesignProblem) -> bool:
    """Whether a file has a design: each says of which suite's loop it is."""
    return any(
        kinds.get(problem.kind, {"provenance": ""})["provenance"].startswith(f"{problem.suite} ")
        for kinds in document.get(problem.controller, {}).values()
    )


def _write(
    out: Path, document: dict[str, Any], problem: DesignProblem, result: DesignResult
) -> None:
    suite = frozen_suite(problem.suite)
    provenance = (
        f"{problem.suite} version {suite.version}, {STATIONS} stations of training seed "
        f"{getattr(suite.recipe, 'training_seed', None)}, seed {problem.seed}, "
        f"{1 + SCATTERED + EVALUATIONS} evaluations: cost {result.cost:.4f}, of the defaults "
        f"{result.first_cost:.4f}"
    )
    loops = document.setdefault(problem.controller, {})
    loops.setdefault(result.loop, {})[problem.kind] = {"provenance": provenance, **result.values}
    write_text(out, toml_document(HEAD, DESIGN_SCHEMA, document))
