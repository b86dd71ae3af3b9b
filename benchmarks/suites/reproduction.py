"""The suite of the dissertation's trials: several models, and its goals."""

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.suites.stations import DrawnStation
from benchmarks.suites.suite import Entry, Episode, EpisodePlan, FrozenSuite, SuiteError
from pma_gym.files import is_path
from pma_gym.plant.model import Model, dump_model, load_model

MEASURED = "Measured"
"""What the tables call the dissertation's own trials."""

GOAL_FIGURES = (
    *("displacement_rmse_mm", "rotation_moving_rmse_deg"),
    *("return_above_bound_deg", "wall_time_s"),
)
"""Goals that are one number."""


@dataclass(frozen=True)
class Goals:
    """Figures that the job is measured by; see the suite's file.

    Attributes:
        replay: name of the controller that repeats the dissertation's trials.
        feedback: names of the controllers that the RMSE goals speak of.
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


@dataclass(frozen=True, eq=False, kw_only=True)
class ReproductionSuite(FrozenSuite):
    """Controllers x models x the dissertation's trials; every model is one of the stations.

    Attributes:
        frozen_digest: of all numbers but the models.
        models: names or paths, in the order of the stations; the first is the one that goals
            speak of.
        pictured_kpa: by task, pressures whose trials are drawn.
        goals: figures to reach.
        selected: whether something was left out or added.
    """

    frozen_digest: str
    models: tuple[str, ...]
    pictured_kpa: Mapping[str, tuple[float, ...]]
    goals: Goals
    selected: bool = False

    keep_pace: ClassVar[bool] = False
    has_lines: ClassVar[bool] = True

    @property
    def controllers(self) -> tuple[ControllerSpec, ...]:
        """Compared controllers, in the order of columns."""
        return tuple(entry.spec for entry in self.entries)

    @property
    def noise(self) -> bool:
        """Whether sensors have noise and quantisation."""
        return bool(self.environment.get("noise", True))

    @property
    def pressures_kpa(self) -> dict[str, tuple[float, ...]]:
        """Pressures of the trials (kPa), by task."""
        return {task: plan.pressures_kpa for plan in self.episode_plans for task in plan.tasks}

    def does(self, controller: ControllerSpec, model: str) -> bool:
        """Return whether a controller runs on a model."""
        return any(
            entry.spec == controller and (not entry.models or model in entry.models)
            for entry in self.entries
        )

    def runs(self, entry: Entry, episode: Episode) -> bool:
        """Return whether a controller runs an episode, by its models and tasks."""
        model = self.models[episode.station]
        return entry.does(episode.task) and (not entry.models or model in entry.models)

    def station(self, number: int) -> DrawnStation:
        """A model by its place."""
        return DrawnStation(self.nominal_of(number), (), ())

    def nominal_of(self, number: int) -> Model:
        """The very model: controllers of this suite know their station exactly."""
        return self._loaded[number]

    @cached_property
    def _loaded(self) -> tuple[Model, ...]:
        return tuple(map(load_model, self.models))

    def seed_of(self, episode: Episode, controller: str = "") -> int:
        """A case's own seed: the same wherever and in whatever order it runs.

        Cases share no noise, and adding a case leaves the others unchanged.
        """
        name = self.case_name(episode, controller)
        return int.from_bytes(hashlib.sha256(f"{self.seed}:{name}".encode()).digest()[:4], "big")

    def case_name(self, episode: Episode, controller: str) -> str:
        """Return a case's unique name, wherever its files lie: `station/pid/rotation/300`."""
        model = Path(self.models[episode.station]).stem
        return f"{model}/{controller}/{episode.task}/{episode.pressure_kpa:g}"

    def is_pictured(self, episode: Episode) -> bool:
        """Return whether the report draws an episode's trials."""
        return episode.station == 0 and episode.pressure_kpa in self.pictured_kpa[episode.task]

    def on(self, models: Sequence[str]) -> "ReproductionSuite":
        """The suite on these models; of a user's file its content counts as a number of the suite.

        Raises:
            ModelError: a file that is no model.
        """
        names = tuple(dict.fromkeys(map(str, models)))
        texts = [dump_model(load_model(name)) if is_path(name) else name for name in names]
        digest = hashlib.sha256("\n".join([self.frozen_digest, *texts]).encode()).hexdigest()[:16]
        return replace(
            self, models=names, model=names[0], stations=tuple(range(len(names))), digest=digest
        )

    def select(
        self,
        models: Sequence[str] = (),
        controllers: Sequence[ControllerSpec] = (),
        tasks: Sequence[str] = (),
        pressures_kpa: Sequence[float] = (),
    ) -> "ReproductionSuite":
        """The suite with other models or controllers, or fewer trials; empty leaves as is.

        Raises:
            SuiteError: a task or pressure that the suite does not have.
        """
        changed: dict[str, Any] = {}
        if controllers:
            changed["entries"] = self._entries_of(controllers)
        if tasks or pressures_kpa:
            trials = self._trials(tasks, pressures_kpa)
            changed["episode_plans"] = tuple(EpisodePlan((t,), kpa) for t, kpa in trials.items())
        same = all(getattr(self, name) == value for name, value in changed.items())
        suite = self.on(models) if models else self
        same = same and suite.models == self.models
        return replace(suite, **changed, selected=self.selected or not same)

    def _entries_of(self, controllers: Sequence[ControllerSpec]) -> tuple[Entry, ...]:
        known = {entry.spec.source: entry for entry in self.entries}
        return tuple(
            known.get(spec.source, Entry(spec))._replace(spec=spec)
            for spec in _distinct(controllers)
        )

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
                known = "; ".join(
                    f"{task}: {', '.join(f'{each:g}' for each in self.pressures_kpa[task])}"
                    for task in trials
                )
                raise SuiteError(
                    f"the dissertation has no trial at {pressure:g} kPa to compare with ({known})"
                )
        return {task: left for task, left in trials.items() if left}


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
