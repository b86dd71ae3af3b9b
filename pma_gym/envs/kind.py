"""What differs between the environments of a station and those of any rig."""

from collections.abc import Callable
from typing import Any, NamedTuple

from pma_gym.engine.actions import CommandLine
from pma_gym.engine.engine import Engine
from pma_gym.engine.options import parse_options, parse_task


class Kind(NamedTuple):
    """A kind of environment.

    Attributes:
        options: checks keyword arguments and returns the options.
        task: returns the task of a name or a Task, for options.
        engine: holds the state and steps it.
        commands: makes the action space, for options and a task.
        reset_options: names of the options of a reset.
    """

    options: Callable[..., Any]
    task: Callable[..., Any]
    engine: type[Engine]
    commands: Callable[..., CommandLine]
    reset_options: tuple[str, ...] = ()


STATION = Kind(
    parse_options,
    parse_task,
    Engine,
    lambda options, task: CommandLine(options, task.actuator),
    ("pressure_kpa",),
)
