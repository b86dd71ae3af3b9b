"""Policies of a study on the frozen suites, as any controller is judged there."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.comparison.job import run_comparison
from benchmarks.executors.executor import Executor
from benchmarks.report.errors import Measure, SuiteRecord, measures
from benchmarks.runner.controller_spec import parse_controllers
from benchmarks.runner.journal import JOURNAL, case_rows
from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.suite import FrozenSuite, kind_of
from benchmarks.training.study.cells import OFF_POLICY, residual_group
from benchmarks.training.study.pooled import Pool

SHIPPED_GROUP = "ppo-increment"
"""Group of the headline algorithm at 100 Hz: its best policies have a column in the tables."""

SHIPPED: tuple[tuple[str, ...], ...] = (
    (SHIPPED_GROUP,),
    ("ppo-increment-late",),
    tuple(residual_group(algorithm) for algorithm in OFF_POLICY),
)
"""Groups of which together the best policy of each task and loop ships."""

PID_FOLDER = "pid"
"""Folder of the PID's results, which learning curves are compared with."""

SUITES = ("nominal", "robust", "hard", "exercise")
"""Suites that policies are judged by."""


def seed_folders(group: Path) -> list[Path]:
    """Folders of a group's seeds that have a policy, in order."""
    folders = [path for path in group.glob("seed-*") if any(path.glob("*.json"))]
    return sorted(folders, key=lambda path: int(path.name.partition("-")[2]))


def judge(
    group: Path, algorithm: str, suite: str, executor: Executor, console: Console
) -> Path | None:
    """Run every seed's policies through a suite; what ran before stays.

    Args:
        group: folder of the seeds.
        algorithm: of the policies.
        suite: name of the suite.
        executor: where the cases run.
        console: where to print.
    Returns:
        The folder of the results; None if there is no policy for the suite's loop.
    """
    frozen = frozen_suite(suite)
    names = ",".join(f"{folder}:{algorithm}" for folder in seed_folders(group))
    specs = parse_controllers(names)
    if not specs[0].kinds & {kind_of(task) for task in frozen.tasks}:
        return None
    entries = [frozen.entry(one) for one in specs]
    able = _able(frozen, entries[0].only, group, algorithm)
    if not able:
        return None
    entries = [entry._replace(only=able) for entry in entries]
    out = group / f"suite-{suite}"
    run_comparison(frozen, entries, out, executor, console)
    return out


def judge_pid(out: Path, executor: Executor, console: Console) -> None:
    """Run the PID through suite `robust`, what curves are compared with."""
    frozen = frozen_suite("robust")
    entries = [frozen.entry(one) for one in parse_controllers("pid")]
    run_comparison(frozen, entries, out / PID_FOLDER, executor, console)


def _able(suite: FrozenSuite, tasks: Sequence[str], group: Path, algorithm: str) -> tuple[str, ...]:
    """Those of some tasks whose kind has a policy of the suite's loop."""
    loop = suite_loop(suite)
    first = seed_folders(group)[0]
    return tuple(
        task for task in tasks if (first / f"{_kind(task)}-{loop}-{algorithm}.json").exists()
    )


def suite_loop(suite: FrozenSuite) -> str:
    """Name of a suite's loop."""
    from controllers.design.designs import loop_name
    from pma_gym.envs import PMAEnv

    environment = PMAEnv("displacement", pressure_kpa=300.0, **suite.environment)
    environment.reset(seed=0)
    return loop_name(environment.station)


def _kind(task: str) -> str:
    from benchmarks.suites.suite import kind_of

    return kind_of(task)


def pools(results: Path, suite: str, seeds: Sequence[str]) -> dict[str, Pool]:
    """Pooled errors by measure.

    Args:
        results: folder of a run.
        suite: name of its suite.
        seeds: names of the contenders.
    """
    frozen = frozen_suite(suite)
    rows = case_rows(results / JOURNAL)
    record = SuiteRecord.of(frozen, [row for row in rows if row["controller"] in seeds])
    by_measure: dict[str, Pool] = {}
    for measure in measures(frozen.tasks):
        if _complete(record, measure, seeds):
            by_measure[measure.name] = Pool(record.errors(measure))
    return by_measure


def _complete(record: SuiteRecord, measure: Measure, seeds: Sequence[str]) -> bool:
    whole = {entry.spec.name for entry in record.whole(measure.tasks)}
    return set(seeds) <= whole
