"""What is installed, and what a model holds, as tables on a terminal."""

import platform
from importlib import metadata

from rich.console import Console
from rich.table import Table

from pma_gym.envs import ENVIRONMENTS
from pma_gym.plant.model import Model, load_model, shipped_models

_PACKAGES = ("pma-gym", "gymnasium", "numpy", "scipy", "llvmlite", "control")


def print_installation(console: Console) -> None:
    """Versions, shipped models and registered environments."""
    versions = Table("package", "version", title="Versions", title_justify="left")
    versions.add_row("python", platform.python_version())
    for name in _PACKAGES:
        versions.add_row(name, metadata.version(name))
    models = Table("model", "plant", "what", title="Models", title_justify="left")
    for name in shipped_models():
        model = load_model(name)
        models.add_row(name, model.plant, model.title)
    environments = Table("environment", "task", title="Environments", title_justify="left")
    for name, task in ENVIRONMENTS.items():
        environments.add_row(name, task)
    for table in (versions, models, environments):
        console.print(table)


def print_model(model: Model, console: Console) -> None:
    """A model's effects and parameters: value, 95 % interval, unit and source."""
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
