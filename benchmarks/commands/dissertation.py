"""The commands about the dissertation: its profiles, tables, feed-forward, studies and model."""

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import (
    Jobs,
    OptionalOut,
    Out,
    app,
)
from benchmarks.files import RESULTS


@app.command(epilog="Example: python -m benchmarks profiles --out profiles.csv")
def profiles(out: Out) -> None:
    """Regenerate the dissertation's voltage profiles (tables I4-I20)."""
    from benchmarks.dissertation import run_profiles

    print(f"{run_profiles(out)} rows in {out}")


@app.command(epilog="Example: python -m benchmarks measured --jobs 2")
def measured(
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = RESULTS / "measured",
    jobs: Jobs = 2,
    seed: Annotated[int, typer.Option(min=0, help="Seed of simulated chance.")] = 0,
    write: Annotated[
        Path | None,
        typer.Option(help="Write the trials to this folder, for pma-gym diagnose, and stop."),
    ] = None,
) -> None:
    """Diagnose the dissertation's tables I2 and I3; an interrupted run goes on where it stopped."""
    from benchmarks.measured.diagnose_tables import run_measured, write_trials

    for folder, option in ((out, "--out"), (write, "--write")):
        if folder is not None and folder.exists() and not folder.is_dir():
            raise ValueError(f"{option} {folder} is a file; name a folder")
    if write is not None:
        print(f"{write_trials(write)} trials in {write}")
        return
    run_measured(out, jobs, seed)


@app.command(
    epilog="Example: python -m benchmarks voltages --controller improved_feedforward "
    "--task rotation --pressure 400 --out volts.csv"
)
def voltages(
    controller: Annotated[
        str, typer.Option(help="serres_replay, serres_feedforward or improved_feedforward.")
    ],
    task: Annotated[str, typer.Option(help="Name of a task, such as displacement or rotation.")],
    pressure: Annotated[float, typer.Option(help="Gauge pressure (kPa).")],
    out: Out,
    rate: Annotated[float, typer.Option(help="Rows a second (Hz), each held.")] = 100.0,
    model: Annotated[
        str, typer.Option(help="Nominal model: shipped name or TOML file.")
    ] = "station",
) -> None:
    """Write a feed-forward's voltages for a real rig as CSV."""
    from benchmarks.dissertation import Order, run_voltages

    rows = run_voltages(Order(controller, task, pressure, rate, model), out)
    print(f"{rows} rows in {out}")


@app.command(epilog="Example: python -m benchmarks studies --out studies.csv")
def studies(out: OptionalOut = None) -> None:
    """Recompute the dissertation's regressions and variance tables beside the printed ones."""
    from benchmarks.dissertation import run_studies

    run_studies(out)


@app.command(epilog="Example: python -m benchmarks identify --out station.toml")
def identify(out: Out, jobs: Jobs = 2) -> None:
    """Fit the station's model from tables I2 and I3; judge it on left-out pressures and I1."""
    from benchmarks.identification.identify import run_identify

    run_identify(out, jobs)
