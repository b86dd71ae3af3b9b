"""`pma-gym compare`: misfit of a model to a lab's logs, without a fit."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from pma_gym.cli.options import JsonOption
from pma_gym.cli.terminal import console, model_names, print_json, say, warnings_said
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.plant.model import load_model

DEFAULT_MODEL = "station"


def compare(
    dataset: Annotated[
        Path,
        typer.Argument(help="Folder of logs (CSV, XLSX, Parquet, LVM, MAT, TDMS...), one a trial."),
    ],
    model: Annotated[
        str | None,
        typer.Option(
            help="Shipped name or TOML file; else the data set's own, else station.",
            autocompletion=model_names,
        ),
    ] = None,
    trials: Annotated[
        Path | None,
        typer.Option(help="trials.toml of a diagnosis or a fit: zeros and starts of the trials."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Simulate a lab's trials with a model and print the misfit of every signal."""
    from pma_gym.discovery.fitting.trial_states import misfits, read_states
    from pma_gym.discovery.preparation.data_checks.checking import check_dataset
    from pma_gym.discovery.preparation.prepared_trials import prepared
    from pma_gym.discovery.report.figure_text import figure, signal_name, signal_unit

    with warnings_said():
        data = read_dataset(dataset)
    compared = load_model(model or data.model or DEFAULT_MODEL)
    states = read_states(trials) if trials else {}
    checked = check_dataset(data, compared, stop=False)
    named, remarks = prepared(checked.trials, compared)
    for line in (*(checked.checked or ()), *remarks):
        say(f"warning: {line}")
    absent = [each.name for each in named if trials and each.name not in states]
    if absent:
        say(
            f"warning: {trials} has no state of {', '.join(absent[:3])}"
            f"{' and others' if len(absent) > 3 else ''}; they begin as the model says"
        )
    sizes = misfits(named, compared, states)
    if as_json:
        print_json({"model": compared.name, "misfit_rms": sizes})
        return
    table = Table("signal", title=f"Misfit of {compared.name} (rms)", title_justify="left")
    table.add_column("misfit", justify="right")
    table.add_column("unit")
    for signal, size in sizes.items():
        table.add_row(signal_name(signal), figure(size), signal_unit(signal))
    console().print(table)
