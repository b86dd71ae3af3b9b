"""`pma-gym`: simulate commands, evaluate trials, look at models, from a shell."""

import platform
import sys
import warnings
from collections.abc import Sequence
from enum import StrEnum
from importlib import metadata
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pma_gym.data.trial import Trial, TrialError
from pma_gym.data.trial_columns import SampleError
from pma_gym.data.trial_files import (
    TrialWarning,
    check_writable,
    place_in_file,
    read_trial,
    write_trial,
)
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import Value
from pma_gym.envs import ENVIRONMENTS
from pma_gym.plant.model import Model, Note, load_model, shipped_models
from pma_gym.plant.plant import Plant
from pma_gym.tasks import broken_limit

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="A pneumatic muscle's test station, simulated.",
)

_PACKAGES = ("pma-gym", "gymnasium", "numpy", "scipy", "llvmlite", "control")

_PRESSURE_TOLERANCE = 1.0
"""Rounding of a settled pressure (Pa) that is no extrapolation."""

ModelOption = Annotated[str, typer.Option(help="Shipped name or TOML file.")]


class Hold(StrEnum):
    """What happens between two rows of commands."""

    LINEAR = "linear"
    ZERO = "zero"


@app.command()
def simulate(
    commands: Annotated[Path, typer.Argument(help="CSV, Parquet or XLSX with time and commands.")],
    out: Annotated[
        Path, typer.Option(help="File to write, in a folder that exists: .csv, .parquet or .xlsx.")
    ],
    model: ModelOption = "station",
    noise: Annotated[bool, typer.Option(help="Sensor noise and quantisation.")] = True,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    hold: Annotated[
        Hold, typer.Option(help="Join rows linearly, or hold each until the next (zero).")
    ] = Hold.LINEAR,
) -> None:
    """Run a command file through a model and write the trial as the station's log would be."""
    check_writable(out)
    if out.exists() and commands.exists() and out.samefile(commands):
        raise TrialError(f"--out {out} is the command file itself; name another file")
    plant = Plant(load_model(model))
    given = _read(commands)
    try:
        trial = plant.simulate(given, noise, seed, joined=hold is Hold.LINEAR)
    except SampleError as error:
        raise TrialError(error.at(place_in_file(commands, error.sample))) from error
    except ValueError as error:
        raise TrialError(f"{commands.name}: {error}") from error
    write_trial(trial, out)
    for line in _doubts(plant.model, trial):
        _say(f"warning: {line}")
    noisy = f"with noise, seed {seed}" if noise else "without noise"
    print(f"{len(trial)} samples, {trial.duration:.6g} s, on {plant.model.name} {noisy}: {out}")


@app.command()
def evaluate(
    trial: Annotated[Path, typer.Argument(help="A log: CSV, Parquet or XLSX.")],
    task: Annotated[str, typer.Option(help="displacement or rotation.")],
) -> None:
    """Give a logged trial its rows of tables 20-22 or 24-30: regression, variance and RMSE."""
    # Imported here: the studies bring python-control along, and that brings matplotlib.
    from pma_gym.studies import evaluation

    evaluation.print_evaluation(evaluation.evaluate(_read(trial), task), _console())


@app.command()
def info(
    model: Annotated[str | None, typer.Option(help="Show this model's parameters.")] = None,
) -> None:
    """Versions, models and environments; or a model's effects and parameters."""
    if model is None:
        _print_installation(_console())
    else:
        _print_model(load_model(model), _console())


def main(arguments: Sequence[str] | None = None) -> None:
    """The console script: what cannot be used ends in one message and exit code 2."""
    try:
        app(args=None if arguments is None else list(arguments), prog_name="pma-gym")
    # Errors of trials and models are ValueErrors; anything else is a fault of this package.
    except (ValueError, OSError) as error:
        _say(f"error: {error}")
        sys.exit(2)


def _read(path: Path) -> Trial:
    """The trial in a file; what was passed over in it is said."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TrialWarning)
        trial = read_trial(path)
    for warning in caught:
        _say(f"warning: {warning.message}")
    return trial


def _doubts(model: Model, trial: Trial) -> list[str]:
    """Where a simulated trial leaves what the model was identified on, or what a rig endures."""
    doubts = []
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


def _print_installation(console: Console) -> None:
    """Versions, shipped models and registered environments."""
    versions = Table("package", "version", title="Versions", title_justify="left")
    versions.add_row("python", platform.python_version())
    for name in _PACKAGES:
        versions.add_row(name, metadata.version(name))
    models = Table("model", "plant", "what", title="Models", title_justify="left")
    for name in shipped_models():
        model = load_model(name)
        models.add_row(name, model.plant, escape(model.title))
    environments = Table("environment", "task", title="Environments", title_justify="left")
    for name, task in ENVIRONMENTS.items():
        environments.add_row(name, task)
    for table in (versions, models, environments):
        console.print(table)


def _print_model(model: Model, console: Console) -> None:
    """A model's effects and parameters: value, 95 % interval, unit and source."""
    console.print(f"{model.name} ({model.plant}): {model.title}", highlight=False, markup=False)
    table = Table("effect", "parameter")
    for name in ("value", "95 % interval"):
        table.add_column(name, justify="right")
    table.add_column("unit")
    table.add_column("source")
    for effect in model.parameters:
        table.add_section()
        shown = effect
        stems = CATALOGUE[effect].names_at_the_door()
        for door, value in model.at_the_door(effect).items():
            note = model.notes.get(f"{effect}.{door}", Note())
            unit = CATALOGUE[effect].quantities[stems[door]].unit
            cells = (stems[door], _text(value), _interval(note), unit, note.source)
            table.add_row(shown, *map(escape, cells))
            shown = ""
    console.print(table)


def _text(value: Value) -> str:
    if isinstance(value, tuple):
        return ", ".join(_text(one) for one in value)
    return f"{value:.6g}"


def _interval(note: Note) -> str:
    if note.low is None or note.high is None:
        return ""
    return f"{note.low:.4g} to {note.high:.4g}"


def _console() -> Console:
    """Where tables go; as wide as they need where nobody watches."""
    console = Console()
    return console if console.is_terminal else Console(width=160)


def _say(message: str) -> None:
    print(message, file=sys.stderr)


if __name__ == "__main__":
    main()
