"""`pma-gym`: simulate, evaluate, diagnose, fit and export, from a shell."""

import sys
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from pma_gym.cli.convert import compare, convert
from pma_gym.cli.discovery import diagnose, fit
from pma_gym.cli.export import export
from pma_gym.cli.options import JsonOption, StrictTyper
from pma_gym.cli.terminal import (
    NamedModel,
    console,
    dissertation_tasks,
    installation,
    model_document,
    model_names,
    print_installation,
    print_json,
    print_model,
    print_version,
    read,
    say,
)
from pma_gym.cli.watch import watch
from pma_gym.data.files.trial_files import check_writable, place_in_file, write_trial
from pma_gym.data.trial import Trial, TrialError
from pma_gym.data.trial_columns import SampleError
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.tasks import broken_limit
from pma_gym.terminal import safe_streams
from pma_gym.units import SI_FACTORS

app = StrictTyper(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="A pneumatic muscle's test station, simulated.",
    epilog="Example: pma-gym watch --task rotation --video rotation.gif",
)

_PRESSURE_TOLERANCE = 1.0
"""Rounding of a settled pressure (Pa) that is no extrapolation."""


class Interpolate(StrEnum):
    """Interpolation of commands between two rows."""

    FOH = "foh"
    ZOH = "zoh"


@app.callback()
def program(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", callback=print_version, is_eager=True),
    ] = False,
) -> None:
    """A pneumatic muscle's test station, simulated."""


@app.command(
    short_help="Run a command file through a model.",
    epilog="Example: pma-gym simulate ramp.csv --out trial.csv --seed 1",
)
def simulate(
    commands: Annotated[
        Path, typer.Argument(help="A file with time and commands: CSV, XLSX, Parquet...")
    ],
    out: Annotated[
        Path, typer.Option(help="File to write, in a folder that exists: .csv, .parquet or .xlsx.")
    ],
    model: NamedModel = "station",
    noise: Annotated[bool, typer.Option(help="Sensor noise and quantisation.")] = True,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    interpolation: Annotated[
        Interpolate,
        typer.Option(help="Join rows linearly (foh), or hold each until the next (zoh)."),
    ] = Interpolate.FOH,
) -> None:
    """Run a command file through a model and write the trial as the station's log would be."""
    check_writable(out)
    if out.exists() and commands.exists() and out.samefile(commands):
        raise TrialError(f"--out {out} is the command file itself; name another file")
    plant = Plant(load_model(model))
    command_trial = read(commands)
    try:
        trial = plant.simulate(command_trial, noise, seed, interpolation=interpolation.value)
    except SampleError as error:
        raise TrialError(error.at(place_in_file(commands, error.sample))) from error
    except ValueError as error:
        raise TrialError(f"{commands.name}: {error}") from error
    write_trial(trial, out)
    for line in _doubts(plant.model, trial):
        say(f"warning: {line}")
    noisy = f"with noise, seed {seed}" if noise else "without noise"
    print(f"{len(trial)} samples, {trial.duration:.6g} s, on {plant.model.name} {noisy}: {out}")


@app.command(
    short_help="Score a logged trial as the dissertation does.",
    epilog="Example: pma-gym evaluate trial.csv --task displacement",
)
def evaluate(
    trial: Annotated[Path, typer.Argument(help="A log: CSV, XLSX, Parquet, LVM, MAT, TDMS...")],
    task: Annotated[
        str, typer.Option(help="displacement or rotation.", autocompletion=dissertation_tasks)
    ],
    as_json: JsonOption = False,
) -> None:
    """Score a logged trial as tables 20-22 or 24-30 do: regression, variance and RMSE."""
    # Imported here: the studies bring python-control along, and that brings matplotlib.
    from pma_gym.studies import evaluation

    rows = evaluation.evaluate(read(trial), task)
    if as_json:
        print_json(rows.documents())
    else:
        evaluation.print_evaluation(rows, console())


@app.command(
    short_help="Versions and models; a model's parameters.",
    epilog="Example: pma-gym info --model station",
)
def info(
    model: Annotated[
        str | None,
        typer.Option(help="Show this model's parameters.", autocompletion=model_names),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Versions, models and environments; or a model's effects and parameters."""
    if as_json:
        print_json(installation() if model is None else model_document(load_model(model)))
    elif model is None:
        print_installation(console())
    else:
        print_model(load_model(model), console())


app.command(
    short_help="Draft dataset.toml for a lab's files.",
    epilog="Example: pma-gym convert logs",
)(convert)
app.command(
    short_help="Find where logs and model disagree, and why.",
    epilog="Example: pma-gym diagnose logs --model station --jobs 4",
)(diagnose)
app.command(
    short_help="Refit a model's parameters to logs.",
    epilog="Example: pma-gym fit logs --model station --out fitted",
)(fit)
app.command(
    short_help="Print the misfit of a model to logs.",
    epilog="Example: pma-gym compare logs --model fitted/model.toml",
)(compare)
app.command(
    short_help="Write a model as C, as an FMU or for MuJoCo.",
    epilog="Example: pma-gym export station --to fmu --start 1,5",
)(export)
app.command(
    epilog="Example: pma-gym watch --task rotation --controller controllers:PID --video pid.gif"
)(watch)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the console script; unusable input ends in one message and exit code 2."""
    with safe_streams():
        try:
            app(args=None if arguments is None else list(arguments), prog_name="pma-gym")
        # Errors of trials and models are ValueErrors; anything else is a fault of this package.
        except (ValueError, OSError) as error:
            say(f"error: {error}")
            sys.exit(2)


def _beyond_joint_range(model: Model, trial: Trial) -> list[str]:
    """Where the arm of a muscle joint leaves its range, or a muscle its pressure."""
    joint = model.parameters.get("joint_range")
    if joint is None:
        return []
    ends = {"angle": (joint.lowest, joint.highest), "pressure": (0.0, joint.pressure)}
    doubts = []
    for signal in model.rig.signals:
        low, high = ends.get(signal.measures, (-np.inf, np.inf))
        values = trial.truth[signal.name]
        if values.min() < low - _ROUNDING or values.max() > high + _ROUNDING:
            numbers = np.array([values.min(), values.max(), low, high]) / SI_FACTORS[signal.unit]
            doubts.append(
                "{} goes from {:.4g} to {:.4g}, beyond the {:.4g} to {:.4g} of [joint_range]: a "
                "real arm would have been stopped".format(signal.column, *numbers)
            )
    return doubts


_ROUNDING = 1e-6
"""By how much a pressure (Pa) or an angle (rad) may be beyond its range without a warning."""


def _doubts(model: Model, trial: Trial) -> list[str]:
    """Where a simulated trial leaves what the model was identified on, or what a rig endures."""
    doubts = _beyond_joint_range(model, trial)
    if not model.rig.has_muscle:
        # It has neither a pressure nor limits of its own.
        return doubts
    valid = model.parameters["validity"]
    pressure = trial.truth["pressure"]
    low, high = valid.lowest - _PRESSURE_TOLERANCE, valid.highest + _PRESSURE_TOLERANCE
    outside = np.flatnonzero((pressure < low) | (pressure > high))
    if outside.size:
        doubts.append(
            f"model {model.name} holds for {valid.lowest / 1e3:g} to {valid.highest / 1e3:g} kPa; "
            f"pressure goes from {pressure.min() / 1e3:.4g} to {pressure.max() / 1e3:.4g} kPa and "
            f"leaves that range at {trial.time[outside[0]]:.4g} s: the trial is extrapolated there"
        )
    for extreme in (np.max, np.min):
        limit = broken_limit(
            model, {name: float(extreme(values)) for name, values in trial.truth.items()}
        )
        if limit:
            doubts.append(f"{limit}: a real station would have been stopped")
    return doubts
