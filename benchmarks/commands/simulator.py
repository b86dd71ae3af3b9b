"""The commands about the simulator: `accuracy` and `speed`."""

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import OptionalOut, refuse


def register(app: typer.Typer) -> None:
    """Add the commands to the program."""
    app.command(epilog="Example: python -m benchmarks accuracy --out accuracy.txt")(accuracy)
    app.command(epilog="Example: python -m benchmarks speed --quick --only single")(speed)


def accuracy(out: OptionalOut = None) -> None:
    """Measure the integrator's accuracy; exit code 1 if the default step misses a limit."""
    from benchmarks.accuracy.job import run_accuracy

    raise typer.Exit(0 if run_accuracy(out=out) else 1)


def speed(
    json_file: Annotated[
        Path | None, typer.Option("--json", help="File for all figures, in a folder that exists.")
    ] = None,
    check: Annotated[
        bool,
        typer.Option(help="Only what shows a loss of vectorisation; exit code 1 if so."),
    ] = False,
    only: Annotated[
        str, typer.Option(help="Rows by commas, such as single or 'batch/own*'; else all.")
    ] = "",
    quick: Annotated[bool, typer.Option(help="A smoke run, whose figures say little.")] = False,
) -> None:
    """Measure this package's speed beside other simulators' (`make peers` installs them)."""
    from benchmarks.speed.rows import RequestError
    from benchmarks.speed.run import run_speed

    try:
        code = run_speed(json_file, check, only, quick)
    except RequestError as error:
        refuse(error)
    raise typer.Exit(code)
