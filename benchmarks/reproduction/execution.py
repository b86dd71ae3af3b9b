"""Runs a suite's cases: the same bits for any number of processes, and none lost with another."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from benchmarks.bounds.achievable import achievable_bound
from benchmarks.executors.executor import Executor, run_all
from benchmarks.reproduction.score import Score, score_trial
from benchmarks.runner.isolated_controller import driver
from benchmarks.runner.rollout import make_environment, rollout
from benchmarks.suites.reproduction import Case, Suite
from pma_gym.data.trial import Trial
from pma_gym.plant.plant import Plant


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes:
        score: its figures, or why there are none.
        trial: what happened, for the cases that the report draws.
    """

    score: Score
    trial: Trial | None = None


@dataclass(frozen=True)
class Bound:
    """The smallest RMSE in phase III of rotation that is achievable on a suite's first model.

    Attributes:
        pressure_kpa: of the trial (kPa).
        rmse_deg: the bound (deg); None if it could not be computed.
        failure: why not.
    """

    pressure_kpa: float
    rmse_deg: float | None = None
    failure: str = ""

    @property
    def name(self) -> str:
        """What it is called while it is computed."""
        return f"achievable bound at {self.pressure_kpa:g} kPa"


@dataclass(frozen=True)
class Execution:
    """What was run.

    Attributes:
        outcomes: of the cases, in the suite's order.
        bounds: by pressure (kPa).
        complete: whether it is all of the suite.
    """

    outcomes: tuple[Outcome, ...]
    bounds: Mapping[float, Bound]
    complete: bool


def execute(
    suite: Suite, executor: Executor, on_done: Callable[[str, bool], None] | None = None
) -> Execution:
    """Run every case of a suite, and compute its bounds.

    Args:
        suite: what to run.
        executor: where the cases run.
        on_done: called with the name of each piece as it is done, and whether it failed.
    Returns:
        What was run: all of it, unless Ctrl-C ended it.
    """
    cases, pressures = list(suite.cases()), suite.pressures_kpa.get("rotation", ())
    works: list[partial[Outcome] | partial[Bound]] = [partial(run_case, c, suite) for c in cases]
    works += [partial(run_bound, suite.models[0], pressure) for pressure in pressures]
    outcomes: dict[int, Outcome] = {}
    bounds: dict[float, Bound] = {}

    def keep(index: int, result: object) -> None:
        if index < len(cases):
            case = cases[index]
            outcomes[index] = _outcome(result, Score(case, suite.seed_of(case)))
            name, failure = case.name, outcomes[index].score.failure
        else:
            bound = _bound(result, pressures[index - len(cases)])
            bounds[bound.pressure_kpa] = bound
            name, failure = bound.name, bound.failure
        if on_done is not None:
            on_done(name, bool(failure))

    complete = run_all(works, executor, keep)
    in_order = {pressure: bounds[pressure] for pressure in pressures if pressure in bounds}
    return Execution(tuple(outcomes[index] for index in sorted(outcomes)), in_order, complete)


def run_case(case: Case, suite: Suite) -> Outcome:
    """Run and score one case; an early end by a physical limit is its failure.

    Raises:
        Exception: whatever the controller or the environment raised.
    """
    began = time.perf_counter()
    score = Score(case, suite.seed_of(case))
    environment = make_environment(
        case.task, case.model, case.pressure_kpa, suite.control_rate_hz, suite.noise
    )
    controller = driver(case.controller, environment.options.period, keep_pace=False)
    done = rollout(environment, controller, score.seed, reveal=case.controller.is_bound)
    score = replace(score, steps=done.steps, step_seconds=done.step_seconds)
    if done.ended_by:
        end = f"ended after {done.steps / suite.control_rate_hz:.4g} s by a physical limit"
        return Outcome(replace(score, failure=f"{end}: {done.ended_by}"))
    score = replace(score, phases=score_trial(done.trial, case.task))
    score = replace(score, seconds=time.perf_counter() - began)
    return Outcome(score, done.trial if suite.is_pictured(case) else None)


def run_bound(model: str, pressure_kpa: float) -> Bound:
    """The achievable bound of phase III of rotation on a model."""
    return Bound(pressure_kpa, achievable_bound(model, "rotation", pressure_kpa)["III"])


def compile_models(suite: Suite) -> None:
    """Compile the suite's plants here, once, so that no process finds the cache empty."""
    for model in suite.models:
        Plant(model)


def _outcome(result: object, blank: Score) -> Outcome:
    """A case's outcome; an exception is its failure, and the other cases' no concern."""
    if isinstance(result, Outcome):
        return result
    return Outcome(replace(blank, failure=f"{type(result).__name__}: {result}"))


def _bound(result: object, pressure_kpa: float) -> Bound:
    if isinstance(result, Bound):
        return result
    return Bound(pressure_kpa, failure=f"{type(result).__name__}: {result}")
