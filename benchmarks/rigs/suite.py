"""The frozen suite `joint`: stations drawn by a seed about shipped models, and tasks on them."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from controllers.rigs import RIG_CONTROLLERS
from pma_gym.documents import read_toml
from pma_gym.plant.model import Model, load_model
from pma_gym.tasks import Ranges

ORACLE, POLICY = "oracle", "policy"
"""Names of who is no controller of `RIG_CONTROLLERS`."""

VARIATION = 0.15
"""Share by which parameters are drawn either way where a model has no intervals (assumption)."""

LOADS = ("push", "load")
"""Options of the environment that a task of the suite has or has not."""


def varied(model: Model) -> dict[str, list[float]]:
    """Ranges of what a fit could change: no parts at rest, sensors or rows of numbers."""
    ranges = {}
    for name, effect in model.effects.items():
        if effect.port.startswith("sensor") or name in model.rig.parts and effect.held:
            continue
        for key, value in model.values_in_files(name).items():
            stem = effect.names_in_files()[key]
            quantity = effect.quantities[stem]
            if stem not in effect.held and isinstance(value, float) and value > 0.0:
                ends = sorted((value * (1.0 - VARIATION), value * (1.0 + VARIATION)))
                ranges[f"{name}.{key}"] = [
                    max(ends[0], quantity.lower),
                    min(ends[1], quantity.upper),
                ]
    return ranges


class RigCase(NamedTuple):
    """A task on a station.

    Attributes:
        rig: name of the rig's model.
        task: name of the task.
        station: number of the station.
    """

    rig: str
    task: str
    station: int


@dataclass(frozen=True)
class RigSuite:
    """Stations of several rigs, and tasks that all of them do.

    Attributes:
        document: the suite's file.
    """

    document: Mapping[str, Any]

    @property
    def rigs(self) -> list[str]:
        """Names of the rigs' models."""
        return list(self.document["rigs"])

    @cached_property
    def tasks(self) -> dict[str, Mapping[str, str]]:
        """Tasks by name: their reference and, if any, their load."""
        return {task["name"]: task for task in self.document["tasks"]}

    def cases(self, stations: int | None = None, tasks: Sequence[str] = ()) -> list[RigCase]:
        """Every case, or those of the first stations and of some tasks.

        Raises:
            ValueError: so many stations or such a task it does not have.
        """
        most = self.document["stations"]
        if stations is not None and stations > most:
            raise ValueError(
                f"suite joint has {most} stations of a rig, got --stations {stations}; name 1 to "
                f"{most}"
            )
        for task in tasks:
            if task not in self.tasks:
                raise ValueError(
                    f"suite joint has the tasks {', '.join(self.tasks)}, got --task {task}"
                )
        return [
            RigCase(rig, task, station)
            for rig in self.rigs
            for task in self.tasks
            if task in tasks or not tasks
            for station in range(stations or most)
        ]

    def station(self, rig: str, number: int) -> Model:
        """The true model of a station."""
        nominal = load_model(rig)
        generator = np.random.default_rng([self.document["seed"], self.rigs.index(rig), number])
        return Ranges(varied(nominal))(nominal, generator)

    def options(self, case: RigCase) -> dict[str, Any]:
        """Options of a case's environment, whose model is the one that controllers receive."""
        options = self.training(case.rig)
        load = self.tasks[case.task].get("load")
        for name in LOADS:
            if name != load:
                del options[name]
        truth = self.station(case.rig, case.station)
        return options | {"randomisation": lambda nominal, generator: truth}

    def training(self, rig: str) -> dict[str, Any]:
        """Options of the environment that controllers are tuned and trained on: any station."""
        drawn = {"model": load_model(rig), "randomisation": Ranges(varied(load_model(rig)))}
        return {**drawn, **self.document["environment"], **self.document["rigs"][rig]}

    @property
    def controllers(self) -> list[str]:
        """Names of who is compared: all controllers of rigs, a policy, the oracle."""
        return [*RIG_CONTROLLERS, POLICY, ORACLE]

    def summary(self) -> dict[str, Any]:
        """What `python -m benchmarks suites` tells of it."""
        episodes, rate = len(self.cases()), self.document["environment"]["control_rate_hz"]
        return {key: self.document[key] for key in ("name", "version", "title")} | {
            "stations": len(self.rigs) * self.document["stations"],
            "episodes": episodes,
            "cases": episodes * len(self.controllers),
            "tasks": list(self.tasks),
            "controllers": self.controllers,
            "control_rate_hz": rate,
            "loop": f"{rate:g} Hz",
        }

    @cached_property
    def digest(self) -> str:
        """Of all that moves a figure: the file but its title, and every station's numbers."""
        numbers = {key: value for key, value in self.document.items() if key != "title"}
        stations = dict.fromkeys((case.rig, case.station) for case in self.cases())
        texts = [json.dumps(numbers, sort_keys=True)]
        texts += [repr(dict(self.station(*each).parameters)) for each in stations]
        texts += [repr(dict(load_model(rig).parameters)) for rig in self.rigs]
        return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]


@cache
def joint_suite() -> RigSuite:
    """The suite as it is shipped."""
    return RigSuite(read_toml(Path(__file__).with_name("joint.toml")))
