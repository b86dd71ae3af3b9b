"""Settings of the controllers by loop and task, as `python -m benchmarks design` wrote them."""

import math
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pma_gym.documents import read_json, read_toml
from pma_gym.envs import StationInfo
from pma_gym.tasks import Task

DESIGNS_FILE = Path(__file__).with_name("designs.json")
"""The settings of the controllers here, with where they come from."""

SCHEMA = 1

KINDS = {"extension": "displacement", "rotation": "rotation", "contraction": "contraction"}
"""Kind of a task by the quantity that it asks for; an exercise's is its own."""

EXERCISE_KINDS = ("isokinetic", "moment")
"""Kinds of exercises: of a speed that is prescribed, and of a moment."""

Settings = TypeVar("Settings", bound=NamedTuple)


def designed(
    controller: str,
    station: StationInfo,
    defaults: Mapping[str, Settings],
    path: Path = DESIGNS_FILE,
) -> Settings:
    """Settings of a controller for a station's loop and task.

    The file is keyed controller -> loop -> kind of task -> values. A loop that was not designed
    for takes the settings of the one that is nearest in dead time.

    Args:
        controller: the controller's name.
        station: its period, delays and task.
        defaults: by kind of task (`task_kind`), for what the file does not give.
        path: file of settings.
    Returns:
        The defaults of the task's kind with the file's values in their place.
    Raises:
        ValueError: the task is an exercise, and the controller follows positions; or the file gives
            a value that the settings do not have, or has another schema.
    """
    kind = task_kind(station)
    if kind not in defaults:
        must_give_a_position(station)
    loops = read_settings(path, SCHEMA, "design")["controllers"].get(controller, {})
    known = [name for name, kinds in loops.items() if kind in kinds]
    if not known:
        return defaults[kind]
    values = loops[nearest_loop(loop_name(station), known)][kind]
    strange = [name for name in values if name not in defaults[kind]._fields]
    if strange:
        raise ValueError(
            f"{path.name} gives {controller} the settings {', '.join(strange)}, it has "
            f"{', '.join(defaults[kind]._fields)}; write it anew: python -m benchmarks design"
        )
    return defaults[kind]._replace(**values)


def task_kind(station: StationInfo) -> str:
    """Kind of a station's task, whatever its name: see `kind_of`."""
    return kind_of(station.task)


def kind_of(task: Task) -> str:
    """`displacement`, `rotation` or `contraction`; of an exercise `isokinetic` or `moment`."""
    if task.exercise is not None:
        return EXERCISE_KINDS[0 if task.exercise.prescription is None else 1]
    return KINDS[task.schedule.quantity]


def must_give_a_position(station: StationInfo) -> None:
    """Refuse a task that gives no position to follow.

    Raises:
        ValueError: the task is an exercise; says who can do it.
    """
    if station.task.exercise is not None:
        raise ValueError(
            "this controller follows a position: the task must give one in mm or deg, got "
            f"{station.task.name}, an exercise, in which a person moves and a speed or a moment is "
            "prescribed; take a controller of exercises, such as constant_pressure or exercise_mpc"
        )


def loop_name(station: StationInfo) -> str:
    """Name of a loop: its control rate, and all delay in it if there is any.

    >>> from pma_gym.plant.model import load_model
    >>> from pma_gym.tasks import TASKS
    >>> where = StationInfo(load_model("cascade"), TASKS["displacement"], 3e5, 0.02)
    >>> loop_name(where)
    '50hz'
    >>> from dataclasses import replace
    >>> loop_name(replace(where, action_delay=0.02))
    '50hz_delay20ms'
    """
    delay = 1e3 * (station.action_delay + station.observation_delay)
    return f"{1.0 / station.period:g}hz" + (f"_delay{delay:g}ms" if delay else "")


def nearest_loop(wanted: str, known: list[str]) -> str:
    """The loop whose dead time, a period and the delay, is nearest as a ratio; the first of two."""
    return min(known, key=lambda name: abs(math.log(_dead_time(name) / _dead_time(wanted))))


def _dead_time(loop: str) -> float:
    """Period and delay of a loop (s), read off its name."""
    match = re.fullmatch(r"([0-9.e+-]+)hz(?:_delay([0-9.e+-]+)ms)?", loop)
    if match is None:
        raise ValueError(
            f"a loop is called like 100hz or 50hz_delay20ms (control rate in Hz, delay in ms), "
            f"got {loop!r}; write the settings anew: python -m benchmarks design"
        )
    return 1.0 / float(match[1]) + 1e-3 * float(match[2] or 0.0)


@cache
def read_settings(path: Path, schema: int, command: str) -> dict[str, Any]:
    """A file of settings, read once.

    Args:
        path: the file.
        schema: its version.
        command: of the benchmark, that writes such a file.

    Raises:
        ValueError: the file has another version.
    """
    document = read_toml(path) if path.suffix == ".toml" else read_json(path)
    got = document.get("schema") if isinstance(document, dict) else None
    if got != schema:
        raise ValueError(
            f"{path} must have schema {schema}, got {got!r}; write it anew: "
            f"python -m benchmarks {command}"
        )
    return document
