"""Errors as arrays: what a suite's rows say of its controllers, measure by measure.

A case that failed has the error of the whole range, the worst that following can be: a controller
does not gain by breaking the rig where others only lag.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.report.statistics import Draws, resample
from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.suites.suite import NOMINAL, Entry, Episode, FrozenSuite
from controllers.design.designs import kind_of
from pma_gym.data.trial_schedule import SCHEDULES
from pma_gym.tasks import EVERY_TASK, Task, named_task
from pma_gym.units import SI_FACTORS

Row = Mapping[str, Any]

RETURN = "III"
"""Phase in which a motor lets the muscle pull back, with a floor that no controller beats, for it
cannot push: measured on its own."""

PERCENT = "%"
"""Unit of an error in percent of its task's range."""


class Measure(NamedTuple):
    """An error that controllers are compared by, one number a case.

    Attributes:
        name: as tables call it.
        tasks: tasks that have it.
        unit: mm, deg, or % of the range where tasks of several units are pooled.
        returning: whether it is of phase III, else of all other phases together.
        alone: name of the only phase that counts; empty for what `returning` says.
    """

    name: str
    tasks: tuple[str, ...]
    unit: str
    returning: bool = False
    alone: str = ""

    def phases(self, task: str) -> list[str]:
        """Names of a task's phases that count."""
        if self.alone:
            return [self.alone]
        names = [phase.name for phase in task_of(task).schedule.phases]
        back = RETURN if _returns(task) else ""
        return [name for name in names if (name == back) == self.returning]

    def scale(self, task: str) -> float:
        """The measure's unit by mm or deg of a task."""
        return percent_of(task) if self.unit == PERCENT else 1.0

    def percent(self, task: str) -> float:
        """Percent of the range by the measure's unit, in a task."""
        return 1.0 if self.unit == PERCENT else percent_of(task)

    def of_row(self, row: Row) -> float:
        """The error in a row: root mean square over the samples of the phases that count."""
        task = row["task"]
        schedule = task_of(task).schedule
        if row["failure"]:
            return self.scale(task) * schedule.span / SI_FACTORS[schedule.unit]
        counted = [phase for phase in schedule.phases if phase.name in self.phases(task)]
        squares = [phase.samples * row["phases"][phase.name]["rmse"] ** 2 for phase in counted]
        return self.scale(task) * math.sqrt(sum(squares) / sum(p.samples for p in counted))


def task_of(name: str) -> Task:
    """The task of a name.

    Raises:
        ValueError: there is none; says which there are.
    """
    task = named_task(name)
    if task is None:
        raise ValueError(f"no task {name!r}; there are {', '.join(EVERY_TASK)}")
    return task


def percent_of(task: str) -> float:
    """Percent of a task's range by mm or deg."""
    schedule = task_of(task).schedule
    return 100.0 * SI_FACTORS[schedule.unit] / schedule.span


def measures(tasks: Iterable[str]) -> list[Measure]:
    """Return the measures by which controllers are compared in these tasks.

    Kind of task by kind of task; phase III apart; references that the dissertation did not have,
    of a kind that it had, apart as well. Of an exercise whose speed is prescribed every phase by
    itself too, as table 30 has them.
    """
    groups: dict[tuple[str, bool], list[str]] = {}
    for task in tasks:
        kind = kind_of(task_of(task))
        groups.setdefault((kind, kind in SCHEDULES and task not in SCHEDULES), []).append(task)
    every = []
    for (kind, unseen), names in groups.items():
        title, unit = f"unseen {kind}" if unseen else kind, task_of(names[0]).schedule.unit
        returning = tuple(name for name in names if _returns(name))
        there = Measure(title, tuple(names), unit)
        if returning:
            phases = ", ".join(there.phases(returning[0]))
            every.append(there._replace(name=f"{title} {phases}"))
            every.append(Measure(f"{title} {RETURN}", returning, unit, returning=True))
        else:
            every.append(there)
        if kind == "isokinetic":
            phases = [phase.name for phase in task_of(names[0]).schedule.phases]
            every += [there._replace(name=f"{title} {name}", alone=name) for name in phases]
    return every


def pooled_measure(tasks: Iterable[str]) -> Measure:
    """All tasks together, in percent of their ranges, phase III left out."""
    return Measure("all tasks", tuple(tasks), PERCENT)


def _returns(name: str) -> bool:
    """Whether a task has a phase in which the motor goes back."""
    task = task_of(name)
    return task.actuator == "motor" and any(p.name == RETURN for p in task.schedule.phases)


@dataclass(frozen=True)
class Errors:
    """Errors of controllers in the same cases.

    Attributes:
        measure: which.
        names: of the controllers.
        episodes: the cases.
        values: error (the measure's unit), shape (controllers, cases).
    """

    measure: Measure
    names: tuple[str, ...]
    episodes: tuple[Episode, ...]
    values: NDArray[np.float64]

    @cached_property
    def draws(self) -> Draws:
        """Resamples of the cases: strata are task and pressure, units the stations."""
        trials = [(e.task, e.pressure_kpa) for e in self.episodes]
        tasks = [e.task for e in self.episodes]
        units = [e if e.station == NOMINAL else e.station for e in self.episodes]
        return resample([_numbered(trials), _numbered(tasks)], _numbered(units))

    def of(self, name: str) -> NDArray[np.float64]:
        """A controller's errors, shape (cases,)."""
        return self.values[self.names.index(name)]


def _numbered(labels: list[Any]) -> NDArray[np.int64]:
    """The labels as numbers in order of appearance."""
    numbers = {label: at for at, label in enumerate(dict.fromkeys(labels))}
    return np.array([numbers[label] for label in labels])


@dataclass(frozen=True)
class SuiteRecord:
    """A suite and the rows that a run left, in whatever order they came.

    Attributes:
        suite: what was to be run.
        rows: rows by controller and episode.
    """

    suite: FrozenSuite
    rows: Mapping[tuple[str, Episode], Row]

    @classmethod
    def of(cls, suite: FrozenSuite, rows: Iterable[Row]) -> "SuiteRecord":
        """The rows that are the suite's: of its name, version and episodes; the last of each."""
        known = set(suite.episodes)
        kept = {}
        for row in rows:
            if (row["suite"], row["version"]) == (suite.name, suite.version):
                episode = Episode(*(row[name] for name in Episode._fields))
                if episode in known:
                    kept[row["controller"], episode] = row
        return cls(suite, kept)

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """The suite's controllers, then others that have rows, by name."""
        own = {entry.spec.name for entry in self.suite.entries}
        others = sorted({name for name, _ in self.rows} - own)
        return (*self.suite.entries, *(Entry(ControllerSpec(name)) for name in others))

    def done(self, entry: Entry) -> tuple[int, int]:
        """Count a controller's cases with a row, and all of its cases."""
        planned = [e for e in self.suite.episodes if entry.does(e.task)]
        return sum((entry.spec.name, e) in self.rows for e in planned), len(planned)

    def whole(self, tasks: tuple[str, ...]) -> list[Entry]:
        """Controllers that have a row for every episode of these tasks."""
        episodes = [e for e in self.suite.episodes if e.task in tasks]
        return [
            entry
            for entry in self.entries
            if all((entry.spec.name, episode) in self.rows for episode in episodes)
        ]

    def errors(self, measure: Measure) -> Errors:
        """Errors of the controllers that ran all of a measure's cases.

        As long as none did, of those that ran some, in the cases that all of them ran.
        """
        episodes = [e for e in self.suite.episodes if e.task in measure.tasks]
        names = [entry.spec.name for entry in self.whole(measure.tasks)]
        if not names:
            started = {name for name, e in self.rows if e.task in measure.tasks}
            names = [e.spec.name for e in self.entries if e.spec.name in started]
            episodes = [e for e in episodes if all((name, e) in self.rows for name in names)]
        values = [[measure.of_row(self.rows[name, e]) for e in episodes] for name in names]
        array = np.array(values, dtype=np.float64).reshape(len(names), len(episodes))
        return Errors(measure, tuple(names), tuple(episodes), array)

    def failures(self) -> list[tuple[str, Episode, str]]:
        """Controller, episode and reason of every case without figures."""
        order = {episode: at for at, episode in enumerate(self.suite.episodes)}
        failed = [(name, e, row["failure"]) for (name, e), row in self.rows.items()]
        return sorted((f for f in failed if f[2]), key=lambda f: (f[0], order[f[1]]))


def is_bound(name: str) -> bool:
    """Return whether a controller sees the true plant: a bound for the others, not a rival."""
    return ControllerSpec(name).is_bound
