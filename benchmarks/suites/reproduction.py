"""What the benchmark runs: the frozen suite, and its cases."""

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from benchmarks.runner.controller_spec import ControllerSpec
from pma_gym.documents import read_toml
from pma_gym.tasks import TASKS

SUITES = Path(__file__).parent
SCHEMA = 1

MEASURED = "Measured"
"""What the tables call the dissertation's own trials."""


class SuiteError(ValueError):
    """A selection that the suite cannot make; the message says what there is."""


@dataclass(frozen=True)
class Targets:
    """Figures that the job is measured by; see the suite's file.

    Attributes:
        replay: name of the controller that repeats the dissertation's trials.
        feedback: names of the controllers that the RMSE targets speak of.
        simple_prediction: the replay's mean absolute errors to beat: slope (mm/s), intercept (mm)
            and rmse (mm).
        displacement_rmse_mm: largest RMSE in displacement.
        rotation_moving_rmse_deg: largest RMSE in phases I and II of rotation.
        return_above_bound_deg: largest excess of phase III's RMSE over the achievable bound.
        wall_time_s: largest time of the whole job.
    """

    replay: str
    feedback: tuple[str, ...]
    simple_prediction: Mapping[str, float]
    displacement_rmse_mm: float
    rotation_moving_rmse_deg: float
    return_above_bound_deg: float
    wall_time_s: float


@dataclass(frozen=True)
class Case:
    """One trial to run: a controller at a pressure on a model.

    Attributes:
        model: name or path of the model.
        controller: who drives.
        task: `displacement` or `rotation`.
        pressure_kpa: gauge pressure (kPa).
    """

    model: str
    controller: ControllerSpec
    task: str
    pressure_kpa: float

    @property
    def name(self) -> str:
        """What tells it from the others, wherever its files lie: `station/pid/rotation/300`."""
        return "/".join(
            (Path(self.model).stem, self.controller.name, self.task, f"{self.pressure_kpa:g}")
        )


@dataclass(frozen=True)
class Suite:
    """Controllers x models x trials, and how they are run.

    Attributes:
        name: what the results' folder is called.
        version: changes whenever figures may.
        seed: every case's seed is derived from it.
        control_rate_hz: control steps a second (Hz).
        noise: sensor noise and quantisation.
        models: names or paths; the first is the one that targets speak of.
        controllers: in the order of columns.
        pressures_kpa: by task.
        pictured_kpa: by task, those whose trials are drawn.
        targets: figures to reach.
        only: models that a controller runs on, by its name; all models if it is not there.
        selected: whether something was left out or added.
    """

    name: str
    version: int
    seed: int
    control_rate_hz: float
    noise: bool
    models: tuple[str, ...]
    controllers: tuple[ControllerSpec, ...]
    pressures_kpa: Mapping[str, tuple[float, ...]]
    pictured_kpa: Mapping[str, tuple[float, ...]]
    targets: Targets
    only: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    selected: bool = field(default=False)

    def does(self, controller: ControllerSpec, model: str) -> bool:
        """Whether a controller runs on a model."""
        return model in self.only.get(controller.name, (model,))

    def cases(self) -> Iterator[Case]:
        """Every case, in the order of the results."""
        for model in self.models:
            for controller in self.controllers:
                if not self.does(controller, model):
                    continue
                for task, pressures in self.pressures_kpa.items():
                    for pressure in pressures:
                        yield Case(model, controller, task, pressure)

    def seed_of(self, case: Case) -> int:
        """A case's own seed: the same wherever and in whatever order it runs.

        Cases share no noise, and adding a case leaves the others as they are.
        """
        digest = hashlib.sha256(f"{self.seed}:{case.name}".encode()).digest()
        return int.from_bytes(digest[:4], "big")

    def is_pictured(self, case: Case) -> bool:
        """Whether the report draws this case's trial."""
        pictured = self.pictured_kpa[case.task]
        return case.model == self.models[0] and case.pressure_kpa in pictured

    def select(
        self,
        models: Sequence[str] = (),
        controllers: Sequence[ControllerSpec] = (),
        tasks: Sequence[str] = (),
        pressures_kpa: Sequence[float] = (),
    ) -> "Suite":
        """The suite with other models or controllers, or fewer trials; empty leaves as is.

        Raises:
            SuiteError: a task or pressure that the suite does not have.
        """
        changed: dict[str, Any] = {}
        if models:
            changed["models"] = tuple(dict.fromkeys(models))
        if controllers:
            changed["controllers"] = _distinct(controllers)
        if tasks or pressures_kpa:
            changed["pressures_kpa"] = self._trials(tasks, pressures_kpa)
        same = all(getattr(self, name) == value for name, value in changed.items())
        return replace(self, **changed, selected=self.selected or not same)

    def _trials(
        self, tasks: Sequence[str], pressures: Sequence[float]
    ) -> dict[str, tuple[float, ...]]:
        for task in tasks:
            if task not in self.pressures_kpa:
                raise SuiteError(f"task must be {' or '.join(self.pressures_kpa)}, got {task!r}")
        trials = {
            task: tuple(p for p in known if p in pressures or not pressures)
            for task, known in self.pressures_kpa.items()
            if task in tasks or not tasks
        }
        for pressure in pressures:
            if not any(pressure in left for left in trials.values()):
                known = "; ".join(f"{t}: {_list(self.pressures_kpa[t])}" for t in trials)
                raise SuiteError(
                    f"the dissertation has no trial at {pressure:g} kPa to compare with ({known})"
                )
        return {task: left for task, left in trials.items() if left}


def load_suite(name: str = "reproduction") -> Suite:
    """A suite that comes with the benchmark.

    >>> suite = load_suite()
    >>> len(list(suite.cases()))
    153
    """
    document = read_toml(SUITES / f"{name}.toml")
    if document["schema"] != SCHEMA:
        raise SuiteError(f"{name}.toml has schema {document['schema']}, known is {SCHEMA}")
    unknown = set(document["tasks"]) - set(TASKS)
    if unknown:
        raise SuiteError(f"{name}.toml has unknown tasks: {', '.join(sorted(unknown))}")
    targets = dict(document["targets"])
    targets["feedback"] = tuple(targets["feedback"])
    entries = [dict(entry) for entry in document["controllers"]]
    only = {e["name"]: tuple(e.pop("models")) for e in entries if "models" in e}
    return Suite(
        name=document["name"],
        version=document["version"],
        seed=document["seed"],
        control_rate_hz=document["control_rate_hz"],
        noise=document["noise"],
        models=tuple(document["models"]),
        controllers=tuple(ControllerSpec(**entry) for entry in entries),
        pressures_kpa={t: tuple(v["pressures_kpa"]) for t, v in document["tasks"].items()},
        pictured_kpa={t: tuple(v["pictured_kpa"]) for t, v in document["tasks"].items()},
        targets=Targets(**targets),
        only=only,
    )


def _distinct(controllers: Sequence[ControllerSpec]) -> tuple[ControllerSpec, ...]:
    """The controllers once each, every one with a label of its own.

    Raises:
        SuiteError: two with one name, which no results could tell apart.
    """
    by_name: dict[str, ControllerSpec] = {}
    for controller in controllers:
        rival = by_name.setdefault(controller.name, controller)
        if rival.source != controller.source:
            raise SuiteError(
                f"two controllers are called {controller.name}: {rival.source} and "
                f"{controller.source}; rename one class"
            )
    labels = Counter([MEASURED, *(controller.label for controller in by_name.values())])
    return tuple(
        replace(controller, title=f"{controller.label} ({controller.name})")
        if controller.path and labels[controller.label] > 1
        else controller
        for controller in by_name.values()
    )


def _list(pressures: Sequence[float]) -> str:
    return ", ".join(f"{pressure:g}" for pressure in pressures)
