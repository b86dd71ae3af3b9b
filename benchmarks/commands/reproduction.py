"""The main job, which runs without a command: all controllers on the dissertation's trials."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import (
    INTERRUPTED,
    LOCAL,
    RESULTS,
    ExecutorOption,
    Jobs,
    chosen_executor,
    listed,
    refuse,
)
from benchmarks.executors.executor import Executor


def register(app: typer.Typer) -> None:
    """Make it what the program does without a command."""
    app.callback(epilog="Example: python -m benchmarks --controllers pid --pressures 300")(
        reproduction
    )


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
    try:
        code = reproduce(out, controllers, model, task, pressures, chosen_executor(executor, jobs))
    except KeyboardInterrupt:
        print("Interrupted before the first case; run it again", file=sys.stderr)
        code = INTERRUPTED
    raise typer.Exit(code)


def reproduce(
    out: Path, controllers: str, model: str, task: str, pressures: str, executor: Executor
) -> int:
    """The main job; its exit code."""
    from benchmarks.reproduction.job import run_job
    from benchmarks.runner.controller_spec import ControllerError, parse_controllers
    from benchmarks.suites.frozen import load_suite
    from benchmarks.suites.suite import SuiteError
    from pma_gym.plant.model import ModelError, load_model
    from pma_gym.terminal import SafeConsole

    suite = load_suite()
    try:
        models = listed(model)
        for name in models or suite.models:
            load_model(name)
        chosen = parse_controllers(controllers, suite.controllers) if controllers else []
        suite = suite.select(models, chosen, listed(task), _pressures(pressures))
        if out.exists() and not out.is_dir():
            raise SuiteError(f"--out {out} is a file; name a folder for the results")
    except (ControllerError, ModelError, SuiteError) as error:
        refuse(error)
    return run_job(suite, out, executor, SafeConsole())


def _pressures(text: str) -> list[float]:
    from benchmarks.suites.suite import SuiteError
    from pma_gym.numerals import parse_numbers

    numbers = parse_numbers(text)
    if numbers is None:
        raise SuiteError(f"--pressures must be numbers in kPa by commas, got {text!r}")
    return numbers
