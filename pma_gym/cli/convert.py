"""`pma-gym convert`: show the columns of a lab's files and draft a `dataset.toml` for them.

`pma-gym compare`: misfit of a model to a lab's logs, without a fit.
"""

import os
import warnings
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from pma_gym.cli.options import JsonOption
from pma_gym.cli.terminal import (
    console,
    model_names,
    print_json,
    print_table,
    say,
    warnings_said,
)
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.datasets.dataset_toml import DESCRIPTION, Description
from pma_gym.data.datasets.drafting import SeenColumn, draft, one_line, seen_columns
from pma_gym.data.trial_columns import TrialError
from pma_gym.files import OutputError, replace_file
from pma_gym.pages.document import TextTable
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.sensors import quantities


def convert(
    folder: Annotated[Path, typer.Argument(help="Folder of a lab's files, one a trial.")],
    model: Annotated[
        str,
        typer.Option(
            help="Shipped name or TOML file of the model to check them with.",
            autocompletion=model_names,
        ),
    ] = "station",
    force: Annotated[bool, typer.Option("--force", help=f"Replace a {DESCRIPTION}.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show the columns of a lab's files and draft dataset.toml, to be read and corrected."""
    path = folder / DESCRIPTION
    if path.exists() and not force:
        raise OutputError(f"{path} is there already; --force replaces it, or rename it")
    initial_model = load_model(model)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        columns, count = seen_columns(folder, Description(), quantities(initial_model))
    if not as_json:
        console().print(_table(columns, count))
    title = folder.resolve().name
    # The draft itself is what is checked: it is what a diagnosis will read.
    older = path.read_bytes() if path.exists() else None
    replace_file(path, draft(title, _named(model, folder), columns, ()).encode())
    try:
        said = _checked(folder, initial_model)
        replace_file(path, draft(title, _named(model, folder), columns, said).encode())
    except BaseException:
        if older is not None:
            replace_file(path, older)
        else:
            path.unlink(missing_ok=True)
        raise
    if as_json:
        seen = [_document(each) for each in columns]
        print_json({"tables": count, "columns": seen, "checks": said, "written": str(path)})
        return
    for message in said:
        say(f"check: {message}")
    print(f"Written {path}: read it, correct it, then: pma-gym diagnose {folder}")


def _named(model: str, folder: Path) -> str:
    """A model as dataset.toml names it: a path counts from the data set's folder."""
    is_path = model.endswith(".toml") or "/" in model or "\\" in model
    return Path(os.path.relpath(model, folder)).as_posix() if is_path else model


def _checked(folder: Path, model: Model) -> list[str]:
    """What reading the drafted data set and checking it says."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            dataset = read_dataset(folder)
        except TrialError as error:
            return [str(error)]
    said = [
        str(warning.message)
        for warning in caught
        if "unknown columns are ignored" not in str(warning.message)
    ]
    if not model.rig.is_diagnosable:
        return said
    from pma_gym.discovery.preparation.data_checks import check_dataset

    try:
        return said + list(check_dataset(dataset, model, stop=False).checked or ())
    except TrialError as error:
        return [*said, str(error)]


def _document(column: SeenColumn) -> dict[str, object]:
    """A column of the lab's files and what it is taken for."""
    guess = column.guess
    seen = {"name": column.name, "unit": column.unit, "from": column.low, "to": column.high}
    return seen | {
        "files": column.files,
        "taken_for": guess.column.name if guess and column.chosen else None,
        "factor": guess.factor if guess and column.chosen else None,
        "reason": guess.why if guess else "no known column",
    }


def _table(columns: list[SeenColumn], count: int) -> Table:
    shown = Table(title=f"{count} tables")
    for name in ("column", "unit", "from", "to", "files", "taken for", "factor", "reason"):
        shown.add_column(name)
    for each in columns:
        cells = [one_line(each.name), one_line(each.unit), f"{each.low:.6g}", f"{each.high:.6g}"]
        cells.append(str(each.files))
        if each.guess is None:
            cells += ["", "", "no known column"]
        else:
            other = "" if each.chosen else "left out, also like "
            cells += [f"{other}{each.guess.column.name}", f"{each.guess.factor:.7g}"]
            cells.append(one_line(each.guess.why))
        shown.add_row(*(Text(cell) for cell in cells))
    return shown


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
    rows = [[signal_name(name), signal_unit(name), figure(size)] for name, size in sizes.items()]
    title = f"Misfit of {compared.name} (rms)"
    print_table(TextTable(title, ("signal", "unit", "misfit"), rows, 2))
