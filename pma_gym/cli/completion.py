"""Shell completion of names of models and tasks."""

from collections.abc import Iterable
from typing import Annotated

import typer

from pma_gym.data.trial_schedule import SCHEDULES
from pma_gym.plant.model import shipped_models
from pma_gym.tasks import EVERY_TASK


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
