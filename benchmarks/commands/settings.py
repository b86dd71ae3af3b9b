"""The commands about settings and the simulator; `remake` is for maintainers alone."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import (
    INTERRUPTED,
    EnvironmentOption,
    Jobs,
    OptionalOut,
    app,
    listed,
    refuse,
    require_writable,
)
from benchmarks.files import RESULTS


@app.command(epilog="Example: python -m benchmarks speed --quick --only single")
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
    from benchmarks.speed.run import run_speed

    raise typer.Exit(run_speed(json_file, check, only, quick))


@app.command(hidden=True, epilog="Example: python -m benchmarks remake --list")
def remake(
    only: Annotated[str, typer.Option(help="Steps by commas, see --list; else all.")] = "",
    without: Annotated[str, typer.Option(help="Steps that are left out, by commas.")] = "",
    steps: Annotated[
        bool, typer.Option("--list", help="List the steps and what is left, and stop.")
    ] = False,
    jobs: Jobs = 2,
    out: Annotated[Path, typer.Option(help="Folder of what is done.")] = RESULTS / "remake",
) -> None:
    """Make all anew that depends on the station: model, gains, designs, policies, scores, tables.

    It goes on where it stopped; `git diff` then shows which figures have moved.
    """
    from benchmarks.remake import Remake
    from benchmarks.remake_steps import chain
    from pma_gym.terminal import SafeConsole

    every = chain(jobs)
    names = [step.name for step in every]
    for option, listed_names in (("--only", listed(only)), ("--without", listed(without))):
        for name in listed_names:
            if name not in names:
                raise ValueError(f"{option} takes {', '.join(names)}, got {name!r}")
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
    raise typer.Exit(0 if job.go() else 1)


@app.command(epilog="Example: python -m benchmarks tune --only '50hz*/rotation' --out gains.toml")
def tune(
    out: OptionalOut = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    model: Annotated[str, typer.Option(help="Shipped name or TOML file.")] = "station",
    jobs: Jobs = 2,
    only: Annotated[
        str, typer.Option(help="Tables by loop and kind of task, such as '50hz*/rotation'.")
    ] = "*",
    tasks: Annotated[
        str, typer.Option(help="Tasks of any rig, by commas: tune its controllers on these.")
    ] = "",
    environment: EnvironmentOption = "",
    suite: Annotated[
        str, typer.Option(help="joint: tune all controllers of rigs for it, and train policies.")
    ] = "",
) -> None:
    """Tune the gains of the PIDs on a model; without --out, the shipped table of gains."""
    if suite:
        from benchmarks.rigs.joint import tune_joint
        from benchmarks.suites.suite import JOINT

        if suite != JOINT:
            raise ValueError(
                f"--suite takes {JOINT} alone (see `design` for others), got {suite!r}"
            )
        tune_joint(RESULTS / JOINT)
        return
    if tasks:
        if out or only != "*":
            refuse(ValueError("--tasks keeps settings in results/rigs: leave out --out and --only"))
        from rich.progress import Progress

        from benchmarks.rigs.run import chosen_controllers, rig_options

        folder = RESULTS / "rigs" / Path(model).stem
        with Progress() as progress:
            made = chosen_controllers(
                [], rig_options(model, environment), listed(tasks), folder, progress
            )
        for name, (controller, _) in made.items():
            print(f"{name}: {controller.chosen or 'no settings'}")
        print(f"Kept in {folder}, where `run --model {model}` takes them from")
        return
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


@app.command(epilog="Example: python -m benchmarks design --controllers lqg --out designs.toml")
def design(
    controllers: Annotated[
        str, typer.Option(help="Names by commas; else all that have settings.")
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
    only: Annotated[
        str, typer.Option(help="Designs by suite and kind of task, such as 'hard/*'.")
    ] = "*",
) -> None:
    """Search the settings of controllers on training stations; without --out, the shipped file."""
    from benchmarks.tuning.design import run_design
    from controllers.design.designs import DESIGNS_FILE

    complete = run_design(listed(controllers), out or DESIGNS_FILE, seed, jobs, recompute, only)
    raise typer.Exit(0 if complete else INTERRUPTED)
