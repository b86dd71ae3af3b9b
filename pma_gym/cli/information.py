"""What is installed, and what a model holds, as tables on a terminal."""

import platform
from importlib import metadata

from rich.console import Console
from rich.table import Table

from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import Value
from pma_gym.envs import ENVIRONMENTS
from pma_gym.plant.model import Model, Note, load_model, shipped_models

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
    for effect in model.parameters:
        table.add_section()
        shown = effect
        stems = CATALOGUE[effect].names_at_the_door()
        for door, value in model.at_the_door(effect).items():
            note = model.notes.get(f"{effect}.{door}", Note())
            unit = CATALOGUE[effect].quantities[stems[door]].unit
            cells = (stems[door], _text(value), _interval(note), unit, note.source)
            table.add_row(shown, *cells)
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
