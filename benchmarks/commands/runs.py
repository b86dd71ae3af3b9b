"""The commands about suites, their runs and comparisons; `targets` is for maintainers alone."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from benchmarks.commands.options import (
    LOCAL,
    EnvironmentOption,
    ExecutorOption,
    Jobs,
    app,
    listed,
)
from benchmarks.executors.choice import executor_named
from benchmarks.executors.executor import Executor
from benchmarks.files import RESULTS
from pma_gym.cli.options import JsonOption
from pma_gym.cli.terminal import print_json, print_table

if TYPE_CHECKING:
    from benchmarks.suites.suite import Entry, FrozenSuite


@app.command(hidden=True, epilog="Example: python -m benchmarks targets robust")
def targets(
    suite: Annotated[str, typer.Argument(help="Name, see `suites`, or path of a TOML file.")],
    results: Annotated[
        Path | None, typer.Option(help="Folder of the run; results/SUITE if not given.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Check a run against what its suite asks for; exit code 1 if a target is missed."""
    from benchmarks.bounds import Bounds
    from benchmarks.report.leaderboard import read_leaderboard
    from benchmarks.report.tables import verdict_table
    from benchmarks.reproduction.reproduce import targets_again
    from benchmarks.reproduction.targets import target_table
    from benchmarks.suites.frozen import frozen_suite
    from benchmarks.suites.reproduction import ReproductionSuite

    frozen = frozen_suite(suite)
    folder = results or RESULTS / frozen.name
    if isinstance(frozen, ReproductionSuite):
        checks = targets_again(frozen, folder, executor_named(LOCAL, 2))
        table = target_table(checks, frozen.models[0])
    else:
        checks = read_leaderboard(frozen, folder, Bounds(frozen.model, folder)).verdicts
        table = verdict_table(checks)
    documents = [check.document() for check in checks]
    if as_json:
        print_json(documents)
    else:
        print_table(table)
    raise typer.Exit(1 if any(each["verdict"] == "missed" for each in documents) else 0)


@app.command(
    epilog="Example: python -m benchmarks run --suite robust --controllers pid,mine.py:Mine"
)
def run(
    suite: Annotated[
        str, typer.Option(help="Name, see `suites`, or TOML file; or give --model.")
    ] = "",
    controllers: Annotated[
        str, typer.Option(help="Names or path/to/file.py:ClassName, by commas; or all.")
    ] = "all",
    jobs: Jobs = 2,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the results; results/SUITE if not given.")
    ] = None,
    executor: ExecutorOption = LOCAL,
    stations: Annotated[
        int | None, typer.Option(min=1, help="Only the first ones, for a quick look.")
    ] = None,
    task: Annotated[
        str, typer.Option("--task", "--tasks", help="Only these tasks, by commas; all if empty.")
    ] = "",
    traces: Annotated[
        Literal["csv", "parquet"] | None, typer.Option(help="Also write every case's time series.")
    ] = None,
    model: Annotated[str, typer.Option(help="In place of a suite: any rig's model.")] = "",
    environment: EnvironmentOption = "",
    seeds: Annotated[int, typer.Option(min=1, help="Episodes of a task of --model.")] = 10,
) -> None:
    """Compare controllers on a suite or a rig's model; a stopped run goes on."""
    of_rigs = [] if controllers == "all" else listed(controllers)
    if model:
        from benchmarks.rigs.run import run_rig

        folder = out or RESULTS / "rigs" / Path(model).stem
        run_rig(model, listed(task), of_rigs, environment, seeds, folder)
        return
    if not suite:
        raise ValueError("run needs --suite NAME, or --model FILE for any rig")
    from benchmarks.suites.suite import JOINT

    places = executor_named(executor, jobs)
    if suite == JOINT:
        from benchmarks.rigs.joint import run_joint

        if traces:
            raise ValueError(f"suite {JOINT} writes no time series; leave --traces out")
        run_joint(of_rigs, stations, listed(task), out or RESULTS / JOINT, places)
        return
    from benchmarks.comparison.job import run_comparison
    from benchmarks.reproduction.reproduce import run_job
    from benchmarks.suites.reproduction import ReproductionSuite
    from pma_gym.data.files.trial_formats import needed
    from pma_gym.terminal import SafeConsole

    if traces == "parquet":
        needed("pyarrow", "--traces parquet")
    part, entries = _selected(suite, controllers, stations, task)
    folder = out or RESULTS / part.name
    if isinstance(part, ReproductionSuite):
        code = run_job(part, folder, places, SafeConsole(), traces or "")
    else:
        code = run_comparison(part, entries, folder, places, SafeConsole(), traces or "")
    raise typer.Exit(code)


@app.command(epilog="Example: python -m benchmarks record nominal --to parquet --controllers pid")
def record(
    suite: Annotated[str, typer.Argument(help="Name, see `suites`, or path of a TOML file.")],
    to: Annotated[
        Literal["parquet", "minari"],
        typer.Option(help="A file an episode, or a Minari data set a task."),
    ] = "parquet",
    controllers: Annotated[
        str, typer.Option(help="Names or path/to/file.py:ClassName, by commas; or all.")
    ] = "all",
    jobs: Jobs = 2,
    out: Annotated[
        Path | None, typer.Option(help="Folder; results/SUITE/episodes if not given.")
    ] = None,
    stations: Annotated[int | None, typer.Option(min=1, help="Only the first ones.")] = None,
    task: Annotated[str, typer.Option(help="Only these tasks, by commas; all if empty.")] = "",
) -> None:
    """Write the controllers' episodes as a data set: observations, actions, rewards, infos."""
    from benchmarks.runner.case import cases
    from benchmarks.runner.episodes import record_cases

    part, entries = _selected(suite, controllers, stations, task)
    folder = out or RESULTS / part.name / "episodes"
    failed = record_cases(cases(part, tuple(entries)), to, folder, executor_named(LOCAL, jobs))
    for name, why in failed.items():
        print(f"{name} failed: {why}")
    print(f"Episodes: {folder}")
    raise typer.Exit(1 if failed else 0)


def _selected(
    suite: str, controllers: str, stations: int | None, task: str
) -> "tuple[FrozenSuite, Sequence[Entry]]":
    """The part of a suite that options name, and who drives it."""
    from benchmarks.comparison.job import chosen
    from benchmarks.suites.frozen import frozen_suite
    from benchmarks.suites.reproduction import ReproductionSuite
    from benchmarks.suites.suite import SuiteError

    frozen = frozen_suite(suite)
    if not isinstance(frozen, ReproductionSuite):
        part = frozen.part(stations, listed(task))
        return part, chosen(part, controllers)
    if stations is not None:
        raise SuiteError(f"suite {frozen.name} has models, no stations; leave --stations out")
    specs = [entry.spec for entry in chosen(frozen, controllers)]
    selected = frozen.select(controllers=specs, tasks=listed(task))
    return selected, selected.entries


@app.command(epilog="Example: python -m benchmarks report robust")
def report(
    suite: Annotated[str, typer.Argument(help="Name, see `suites`, or path of a TOML file.")],
    results: Annotated[
        Path | None, typer.Option(help="Folder of the run; results/SUITE if not given.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the page; that of the run if not given.")
    ] = None,
    vector: Annotated[
        bool, typer.Option("--vector", help="Pictures as SVG and PDF too, beside the PNG.")
    ] = False,
) -> None:
    """Write a suite's page, its leaderboard, from the journal of its run."""
    from benchmarks.executors.choice import local
    from benchmarks.report.leaderboard import run_command
    from benchmarks.report.publish import run_report
    from benchmarks.reproduction.reproduce import report_again
    from benchmarks.suites.frozen import frozen_suite
    from benchmarks.suites.reproduction import ReproductionSuite

    frozen = frozen_suite(suite)
    folder = results or RESULTS / frozen.name
    if isinstance(frozen, ReproductionSuite):
        page = report_again(frozen, folder, out or folder, local(2), vector)
    else:
        page, ranks, incomplete = run_report(frozen, folder, out or folder, vector)
        print_table(ranks)
        if incomplete:
            print(f"Not complete, so not in every column: {incomplete}")
            print(f"Run the rest: {run_command(frozen, folder)}")
    print(f"Report: {page}")


@app.command(epilog="Example: python -m benchmarks compare lqg pid")
def compare(
    first: Annotated[
        str, typer.Argument(help="Controller, folder of one, or FOLDER:CONTROLLER.", metavar="A")
    ],
    second: Annotated[str, typer.Argument(help="Another.", metavar="B")],
    results: Annotated[
        Path | None, typer.Option(help="Folder of the run; that of the last one if not given.")
    ] = None,
    task: Annotated[str, typer.Option(help="Only this task; all if empty.")] = "",
) -> None:
    """Say in one line which of two controllers is better, by how much, and if they differ."""
    from benchmarks.comparison.compare import compare as compared

    print(compared(first, second, results, task))


@app.command(epilog="Example: python -m benchmarks add mine.py:Mine --suite hard")
def add(
    controller: Annotated[str, typer.Argument(help="path/to/file.py:ClassName")],
    suite: Annotated[str, typer.Option(help="Suites by commas; else all but `many`.")] = "",
    jobs: Jobs = 2,
    results: Annotated[
        Path, typer.Option(help="Folder with a folder of results for each suite.")
    ] = RESULTS,
) -> None:
    """Score your own controller on all suites, and say where it stands or what to fix."""
    from benchmarks.comparison.add import own_controller, run_add
    from benchmarks.suites.frozen import frozen_suite, suite_names
    from pma_gym.terminal import SafeConsole

    frozen = [frozen_suite(name) for name in listed(suite) or suite_names()]
    frozen = [one for one in frozen if suite or not one.only_by_name]
    code = run_add(own_controller(controller), frozen, results, jobs, SafeConsole())
    raise typer.Exit(code)


@app.command(epilog="Example: python -m benchmarks remove Mine --suite hard")
def remove(
    controller: Annotated[str, typer.Argument(help="Name as the journal has it: the class.")],
    suite: Annotated[str, typer.Option(help="Suites by commas; else all.")] = "",
    results: Annotated[
        Path, typer.Option(help="Folder with a folder of results for each suite.")
    ] = RESULTS,
) -> None:
    """Take a controller's rows out of the journals; the rows of all others stay unchanged."""
    from benchmarks.comparison.job import remove_controller
    from benchmarks.report.leaderboard import report_command
    from benchmarks.suites.frozen import frozen_suite, suite_names

    frozen = [frozen_suite(name) for name in listed(suite) or suite_names()]
    removed = remove_controller(controller, frozen, results)
    by_folder = {results / each.name: each for each in frozen}
    for path, count in removed.items():
        again = report_command(by_folder[path.parent], path.parent)
        print(f"{path}: {count} rows of {controller} removed; update its page: {again}")


@app.command(epilog="Example: python -m benchmarks suites")
def suites(as_json: JsonOption = False) -> None:
    """List the frozen suites: their versions, cases and controllers."""
    from benchmarks.comparison.job import print_suites, suite_documents
    from pma_gym.terminal import SafeConsole

    if as_json:
        print_json(suite_documents())
    else:
        print_suites(SafeConsole())


@app.callback(epilog="Example: python -m benchmarks --controllers pid --pressures 300")
def reproduction(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="Folder.")] = RESULTS / "reproduction",
    controllers: Annotated[
        str, typer.Option(help="Names or file.py:Class by commas; else all.")
    ] = "",
    model: Annotated[
        str,
        typer.Option(help="Names or TOML files by commas; else the suite's."),
    ] = "",
    task: Annotated[str, typer.Option(help="displacement or rotation; else both.")] = "",
    pressures: Annotated[str, typer.Option(help="In kPa by commas; else all.")] = "",
    jobs: Jobs = 2,
    executor: ExecutorOption = LOCAL,
) -> None:
    """Run every controller through every trial and write the report."""
    if context.invoked_subcommand is not None:
        return
    code = reproduce(out, controllers, model, task, pressures, executor_named(executor, jobs))
    raise typer.Exit(code)


def reproduce(
    out: Path, controllers: str, model: str, task: str, pressures: str, executor: Executor
) -> int:
    """The main job; its exit code."""
    from benchmarks.reproduction.reproduce import run_job
    from benchmarks.runner.controller_spec import parse_controllers
    from benchmarks.suites.frozen import load_suite
    from benchmarks.suites.suite import SuiteError
    from pma_gym.plant.model import load_model
    from pma_gym.terminal import SafeConsole

    suite = load_suite()
    models = listed(model)
    for name in models or suite.models:
        load_model(name)
    chosen = parse_controllers(controllers, suite.controllers) if controllers else []
    suite = suite.select(models, chosen, listed(task), _pressures(pressures))
    if out.exists() and not out.is_dir():
        raise SuiteError(f"--out {out} is a file; name a folder for the results")
    return run_job(suite, out, executor, SafeConsole())


def _pressures(text: str) -> list[float]:
    from benchmarks.suites.suite import SuiteError
    from pma_gym.units import parse_numbers

    numbers = parse_numbers(text)
    if numbers is None:
        raise SuiteError(f"--pressures must be numbers in kPa by commas, got {text!r}")
    return numbers
