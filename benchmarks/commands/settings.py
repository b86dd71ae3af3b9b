"""The commands that search controllers' settings: `tune` and `design`."""

import sys
from typing import Annotated

import typer

from benchmarks.commands.options import (
    INTERRUPTED,
    Again,
    Jobs,
    OptionalOut,
    listed,
    refuse,
    require_writable,
)


def register(app: typer.Typer) -> None:
    """Add the commands to the program."""
    app.command(
        epilog="Example: python -m benchmarks tune --only '50hz*/rotation' --out gains.toml"
    )(tune)
    app.command(epilog="Example: python -m benchmarks design --controllers lqg --out designs.json")(
        design
    )


def tune(
    out: OptionalOut = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    model: Annotated[str, typer.Option(help="Shipped name or TOML file.")] = "station",
    jobs: Jobs = 2,
    only: Annotated[
        str, typer.Option(help="Tables by loop and kind of task, such as '50hz*/rotation'.")
    ] = "*",
) -> None:
    """Tune the gains of the PIDs on a model; without --out, the shipped table of gains."""
    from benchmarks.tuning.tune import GAINS_FILE, TuneError, run_tune

    out = out or GAINS_FILE
    require_writable(out, "--out")
    try:
        written = run_tune(out, seed, model, jobs, only)
    except ValueError as error:
        refuse(error)
    except TuneError as error:
        print(f"error: {error}", file=sys.stderr)
        raise typer.Exit(1) from None
    raise typer.Exit(0 if written else INTERRUPTED)


def design(
    controllers: Annotated[
        str, typer.Option(help="Names by commas; all that have settings if empty.")
    ] = "",
    out: OptionalOut = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    jobs: Jobs = 2,
    recompute: Annotated[
        bool,
        typer.Option(
            "--recompute", help="Also what the file has already; else only what is missing."
        ),
    ] = False,
    again: Again = False,
    only: Annotated[
        str, typer.Option(help="Designs by suite and kind of task, such as 'hard/*'.")
    ] = "*",
) -> None:
    """Search the settings of controllers on training stations; without --out, the shipped file."""
    from benchmarks.tuning.design import run_design
    from controllers.design.designs import DESIGNS_FILE

    try:
        complete = run_design(
            listed(controllers), out or DESIGNS_FILE, seed, jobs, recompute or again, only
        )
    except ValueError as error:
        refuse(error)
    raise typer.Exit(0 if complete else INTERRUPTED)
