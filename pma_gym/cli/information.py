"""Tables of the installation and of a model, for the terminal."""

import platform
from importlib import metadata
from typing import Any

import typer
from rich.console import Console
from rich.table import Table

from pma_gym import __version__
from pma_gym.envs import ENVIRONMENTS
from pma_gym.plant.model import Model, load_model, shipped_models

_PACKAGES = ("pma-gym", "gymnasium", "numpy", "scipy", "llvmlite", "control")


def print_version(wanted: bool) -> None:
    """Print the version and exit, for `--version`."""
    if wanted:
        print(f"pma-gym {__version__}")
        raise typer.Exit


def installation() -> dict[str, Any]:
    """Versions, shipped models and registered environments."""
    versions = {name: metadata.version(name) for name in _PACKAGES}
    models = [load_model(name) for name in shipped_models()]
    return {
        "versions": {"python": platform.python_version(), **versions},
        "models": [{"name": m.name, "plant": m.plant, "title": m.title} for m in models],
        "environments": [{"id": name, "task": task} for name, task in ENVIRONMENTS.items()],
    }


def model_document(model: Model) -> dict[str, Any]:
    """Return a model's effects and parameters, in file units."""
    rows = [row._asdict() for row in model.rows()]
    head = {"name": model.name, "plant": model.plant, "title": model.title}
    return head | {"parameters": rows}


def print_installation(console: Console) -> None:
    """Versions, shipped models and registered environments."""
    known = installation()
    versions = Table("package", "version", title="Versions", title_justify="left")
    for package in known["versions"].items():
        versions.add_row(*package)
    models = Table("model", "plant", "what", title="Models", title_justify="left")
    for model in known["models"]:
        models.add_row(*model.values())
    environments = Table("environment", "task", title="Environments", title_justify="left")
    for environment in known["environments"]:
        environments.add_row(*environment.values())
    for table in (versions, models, environments):
        console.print(table)


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
