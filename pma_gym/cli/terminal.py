"""Functions for all commands: tables on the terminal, messages, trials from files.

Shell completion of names of models and tasks.

Tables of the installation and of a model, for the terminal.
"""

import json
import math
import platform
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from pma_gym import __version__
from pma_gym.data.files.trial_files import TrialWarning, read_trial
from pma_gym.data.trial import Trial
from pma_gym.data.trial_schedule import SCHEDULES
from pma_gym.envs import ENVIRONMENTS, RIG_ID
from pma_gym.pages.document import TextTable
from pma_gym.plant.model import Model, load_model, shipped_models
from pma_gym.tasks import EVERY_TASK
from pma_gym.terminal import SafeConsole, table_console


def console() -> SafeConsole:
    """Console for tables; as wide as needed if the output is not a terminal."""
    return table_console()


_SHORT = 18
"""Characters of the longest cell of a column that is never broken."""


def terminal_table(table: TextTable) -> Table:
    """A table for the terminal, as narrow as may be."""
    shown = Table(title=table.title or None, title_justify="left", box=None, padding=(0, 1, 0, 0))
    for column, name in enumerate(table.header):
        justify = "left" if column < table.words else "right"
        short = all(len(row[column]) <= _SHORT for row in table.rows)
        shown.add_column(name.replace(" | ", "\n"), justify=justify, no_wrap=short)
    for row in table.rows:
        shown.add_row(*row)
    return shown


def print_table(table: TextTable) -> None:
    """Print a table on the terminal."""
    console().print(terminal_table(table))


def print_json(document: object) -> None:
    """Print a document for programs; numbers that JSON lacks, such as infinity, are null."""
    print(json.dumps(_finite(document), indent=1, allow_nan=False))


def _finite(document: Any) -> Any:  # noqa: ANN401 - whatever JSON has
    if isinstance(document, dict):
        return {str(key): _finite(value) for key, value in document.items()}
    if isinstance(document, list | tuple):
        return [_finite(value) for value in document]
    return None if isinstance(document, float) and not math.isfinite(document) else document


def say(message: str) -> None:
    """Print a message that is not a result, to stderr."""
    print(message, file=sys.stderr)


@contextmanager
def warnings_said() -> Iterator[None]:
    """Print the warnings of reading trials."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TrialWarning)
        yield
    for warning in caught:
        say(f"warning: {warning.message}")


@contextmanager
def warnings_said_at_once(kind: type[Warning]) -> Iterator[None]:
    """Print warnings of a kind at once; others are handled as before."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", kind)
        show = warnings.showwarning

        def shown(message: Warning | str, category: type[Warning], *where: Any) -> None:
            if issubclass(category, kind):
                say(f"warning: {message}")
            else:
                show(message, category, *where)

        warnings.showwarning = shown  # type: ignore[assignment]
        yield


def read(path: Path) -> Trial:
    """Read the trial in a file, and print its warnings."""
    with warnings_said():
        return read_trial(path)


def model_names(incomplete: str) -> list[str]:
    """Shipped models that begin with a text."""
    return _starting_with(incomplete, shipped_models())


def task_names(incomplete: str) -> list[str]:
    """Tasks that begin with a text."""
    return _starting_with(incomplete, EVERY_TASK)


def dissertation_tasks(incomplete: str) -> list[str]:
    """Tasks of the dissertation that begin with a text."""
    return _starting_with(incomplete, SCHEDULES)


def _starting_with(incomplete: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


NamedModel = Annotated[
    str, typer.Option(help="Shipped name or TOML file.", autocompletion=model_names)
]

_PACKAGES = ("pma-gym", "gymnasium", "numpy", "scipy", "llvmlite", "control")


def print_version(requested: bool) -> None:
    """Print the version and exit, for `--version`."""
    if requested:
        print(f"pma-gym {__version__}")
        raise typer.Exit


def installation() -> dict[str, Any]:
    """Versions, shipped models and registered environments."""
    versions = {name: metadata.version(name) for name in _PACKAGES}
    environments = ENVIRONMENTS | {RIG_ID: "angle_steps, ... of any rig's signals"}
    models = [load_model(name) for name in shipped_models()]
    return {
        "versions": {"python": platform.python_version(), **versions},
        "models": [{"name": m.name, "plant": m.plant, "title": m.title} for m in models],
        "environments": [{"id": name, "task": task} for name, task in environments.items()],
    }


def model_document(model: Model) -> dict[str, Any]:
    """Return a model's effects and parameters, in file units."""
    rows = [row._asdict() for row in model.rows()]
    head = {"name": model.name, "plant": model.plant, "title": model.title}
    return head | {"parameters": rows}


def print_installation(console: Console) -> None:
    """Versions, shipped models and registered environments."""
    known = installation()
    tables = (
        TextTable("Versions", ("package", "version"), list(known["versions"].items()), 2),
        TextTable("Models", ("model", "plant", "what"), _rows(known["models"]), 3),
        TextTable("Environments", ("environment", "task"), _rows(known["environments"]), 2),
    )
    for table in tables:
        console.print(terminal_table(table))


def _rows(documents: list[dict[str, str]]) -> list[list[str]]:
    return [list(each.values()) for each in documents]


def print_model(model: Model, console: Console) -> None:
    """Print a model's effects and parameters: value, 95 % interval, unit and source."""
    console.print(f"{model.name} ({model.plant}): {model.title}", highlight=False, markup=False)
    table = Table("effect", "parameter")
    for name in ("value", "95 % interval"):
        table.add_column(name, justify="right")
    table.add_column("unit")
    table.add_column("source")
    before = ""
    for row in model.rows():
        if row.effect != before:
            table.add_section()
        shown, before = "" if row.effect == before else row.effect, row.effect
        table.add_row(shown, row.parameter, row.value_text, row.interval_text, row.unit, row.source)
    console.print(table)
