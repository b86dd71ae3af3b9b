"""The command that makes anew what depends on the station's model: `remake`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import INTERRUPTED, RESULTS, Jobs, listed, refuse


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command(epilog="Example: python -m benchmarks remake --list")(remake)


def remake(
    only: Annotated[str, typer.Option(help="Steps by commas, see --list; else all.")] = "",
    without: Annotated[str, typer.Option(help="Steps that are left out, by commas.")] = "",
    steps: Annotated[
        bool, typer.Option("--list", help="List the steps and what is left, and stop.")
    ] = False,
    table: Annotated[
        bool, typer.Option("--table", help="Show figures that moved since it began, and stop.")
    ] = False,
    jobs: Jobs = 2,
    out: Annotated[
        Path, typer.Option(help="Folder of what is done, old figures, and the table.")
    ] = RESULTS / "remake",
) -> None:
    """Make all anew that depends on the station: model, gains, designs, policies, scores, tables.

    It goes on where it stopped, and ends with a table of old and new figures.
    """
    from benchmarks.remake.chain import chain
    from benchmarks.remake.job import Remake
    from pma_gym.terminal import SafeConsole

    every = chain(jobs)
    names = [step.name for step in every]
    for option, given in (("--only", listed(only)), ("--without", listed(without))):
        for name in given:
            if name not in names:
                refuse(ValueError(f"{option} takes {', '.join(names)}, got {name!r}"))
    chosen = [
        step
        for step in every
        if (not only or step.name in listed(only)) and step.name not in listed(without)
    ]
    job = Remake(chosen, out, SafeConsole())
    if steps:
        left = {step.name for step in job.left()}
        for step in every:
            said = "left" if step.name in left else "done" if step in chosen else "left out"
            print(f"{step.name:10} {said:9} {step.hours:5.1f} h  {step.makes}")
        return
    if table:
        job.table()
        return
    try:
        complete = job.go()
    except KeyboardInterrupt:
        print("Interrupted; run it again, it goes on where it stopped", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    raise typer.Exit(0 if complete else 1)
