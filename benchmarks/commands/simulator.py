"""The command about the simulator: `speed`."""

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import refuse


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command(epilog="Example: python -m benchmarks speed --quick --only single")(speed)


def speed(
    json_file: Annotated[
        Path | None, typer.Option("--json", help="File for all figures, in a folder that exists.")
    ] = None,
    check: Annotated[
        bool,
        typer.Option(help="Only ratios that hold everywhere; exit code 1 if one does not."),
    ] = False,
    only: Annotated[
        str, typer.Option(help="Rows by commas, such as single or 'batch/own*'; else all.")
    ] = "",
    quick: Annotated[bool, typer.Option(help="A smoke run, whose figures say little.")] = False,
) -> None:
    """Measure this package's speed beside other simulators' (`make peers` installs them)."""
    from benchmarks.speed.run import RequestError, run_speed

    try:
        code = run_speed(json_file, check, only, quick)
    except RequestError as error:
        refuse(error)
    raise typer.Exit(code)
