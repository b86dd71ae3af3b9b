"""A suite's leaderboard: all that its page is made from, read from what a run left.

The commands that messages name work as they stand in the folder of the user.
"""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.bounds import Bounds
from benchmarks.files import RESULTS
from benchmarks.report.errors import Errors, Measure, SuiteRecord, measures, pooled_measure, task_of
from benchmarks.report.margins import Condition, conditions, is_linear
from benchmarks.report.standings import Standings
from benchmarks.report.tables import standings_table
from benchmarks.report.verdicts import Verdict, verdicts
from benchmarks.runner.provenance import check_run, finished_rows, read_run
from benchmarks.suites.suite import Entry, FrozenSuite, SuiteError
from controllers import CONTROLLERS
from pma_gym.envs import StationInfo
from pma_gym.pages.figures import notebook_html
from pma_gym.tasks import ISOTONIC, TASKS, infeasibility_reason


def run_command(suite: FrozenSuite, folder: Path) -> str:
    """Return the command that runs a suite into a folder.

    >>> from benchmarks.suites.frozen import frozen_suite
    >>> run_command(frozen_suite("nominal"), Path("results/nominal"))
    'python -m benchmarks run --suite nominal'
    >>> run_command(frozen_suite("nominal"), Path("my results"))
    "python -m benchmarks run --suite nominal --out 'my results'"
    """
    return _joined("run", "--suite", suite.source, *_folder("--out", suite, folder))


def report_command(suite: FrozenSuite, folder: Path) -> str:
    """Return the command that writes the report of a folder."""
    return _joined("report", suite.source, *_folder("--results", suite, folder))


def remove_command(name: str, suite: FrozenSuite, folder: Path) -> str:
    """Return the command that removes a controller's rows from a folder's journal."""
    results = [] if folder.parent == RESULTS else ["--results", str(folder.parent)]
    return _joined("remove", name, "--suite", suite.source, *results)


def _folder(option: str, suite: FrozenSuite, folder: Path) -> list[str]:
    return [] if folder == RESULTS / suite.name else [option, str(folder)]


def _joined(*words: str) -> str:
    return shlex.join(["python", "-m", "benchmarks", *words])


LOOP_TASKS = (*TASKS, *ISOTONIC)
"""Tasks whose loops are shown, the motor's and the regulator's. Unseen references have those of the
dissertation's tasks; in an exercise the operator is part of the loop."""


@dataclass(frozen=True)
class Leaderboard:
    """All that a suite's page is made from.

    Attributes:
        record: the suite and its rows.
        info: what the run was made with; empty if that is not known.
        bounds: achievable bounds on the suite's model; computed here, and not kept, if None.
    """

    record: SuiteRecord
    info: Mapping[str, Any]
    bounds: Bounds | None = None

    @property
    def suite(self) -> FrozenSuite:
        """The suite."""
        return self.record.suite

    @cached_property
    def labels(self) -> dict[str, str]:
        """The controllers' labels by name, in the suite's order."""
        titles = {name: entry["title"] for name, entry in self.info.get("contenders", {}).items()}
        entries = (entry.spec for entry in self.record.entries)
        return {each.name: each.title or titles.get(each.name, each.name) for each in entries}

    @cached_property
    def standings(self) -> dict[str, Standings]:
        """Standings by measure: each kind of task, each way, and all tasks if there are several."""
        tasks = self.suite.tasks
        listed = measures(tasks)
        if len(listed) > 1:
            listed.append(pooled_measure(tasks))
        return {measure.name: self.standings_of(measure) for measure in listed}

    @property
    def shown(self) -> list[Standings]:
        """Standings with somebody in them; the last is of all tasks together, or the only one."""
        return [each for each in self.standings.values() if each.errors.values.size]

    @cached_property
    def by_task(self) -> dict[str, Standings]:
        """Standings in every single task, phase III left out, where measures hold several."""
        if all(len(each.tasks) == 1 for each in measures(self.suite.tasks)):
            return {}
        standings = {task: self.standings_in(task) for task in self.suite.tasks}
        return {name: each for name, each in standings.items() if each.errors.values.size}

    def standings_of(self, measure: Measure) -> Standings:
        """Standings in a measure."""
        errors = self.record.errors(measure)
        return Standings(errors, self._failed(errors))

    def standings_in(self, task: str) -> Standings:
        """Standings in a single task, phase III left out."""
        return self.standings_of(Measure(task, (task,), task_of(task).schedule.unit))

    def _failed(self, errors: Errors) -> tuple[int, ...]:
        rows = self.record.rows
        return tuple(
            sum(bool(rows[name, episode]["failure"]) for episode in errors.episodes)
            for name in errors.names
        )

    def whole(self, standings: Standings) -> bool:
        """Return whether a measure's standings use all of its cases."""
        tasks = standings.errors.measure.tasks
        planned = sum(episode.task in tasks for episode in self.suite.episodes)
        return len(standings.errors.episodes) == planned and bool(standings.errors.names)

    @cached_property
    def verdicts(self) -> list[Verdict]:
        """The suite's targets; only what all cases have been run for has a figure."""
        known = {name: each for name, each in self.standings.items() if self.whole(each)}
        units = {name: each.errors.measure.unit for name, each in self.standings.items()}
        bounds = self.bounds or Bounds(self.suite.model)
        return verdicts(self.suite.targets, known, self.labels, units, bounds)

    def _repr_html_(self) -> str:
        """What a notebook shows: the standings in every measure."""
        return notebook_html([standings_table(each, self.labels) for each in self.shown])

    @property
    def missing(self) -> list[Entry]:
        """Controllers of the suite without a single row."""
        return [entry for entry in self.record.entries if not self.record.done(entry)[0]]

    @property
    def incomplete(self) -> list[tuple[Entry, int, int]]:
        """Controllers with some of their rows, how many, and of how many."""
        counts = [(entry, *self.record.done(entry)) for entry in self.record.entries]
        return [(entry, done, planned) for entry, done, planned in counts if 0 < done < planned]

    @cached_property
    def obstacles(self) -> dict[tuple[str, float], str]:
        """Why the nominal actuator cannot follow, by task and pressure (kPa)."""
        every = [each.errors.episodes for each in self.shown]
        trials = dict.fromkeys((e.task, e.pressure_kpa) for episodes in every for e in episodes)
        model = self.suite.nominal
        known = {(t, kpa): infeasibility_reason(task_of(t), model, 1e3 * kpa) for t, kpa in trials}
        return {trial: why for trial, why in known.items() if why is not None}

    @cached_property
    def loops(self) -> dict[str, list[Condition]]:
        """Loops of the linear controllers that ran, by task, at three of its pressures."""
        by_task, ran = {}, {(name, episode.task) for name, episode in self.record.rows}
        for task in self.suite.tasks:
            names = [e.spec.name for e in self.record.entries if (e.spec.name, task) in ran]
            own = [CONTROLLERS[name]() for name in names if name in CONTROLLERS]
            if task in LOOP_TASKS and any(map(is_linear, own)):
                by_task[task] = conditions(own, self._station_infos(task))
        return by_task

    def _station_infos(self, task: str) -> list[StationInfo]:
        """What controllers receive at the lowest, middle and highest pressure of a task."""
        suite, environment = self.suite, self.suite.environment
        kpa = sorted({e.pressure_kpa for e in suite.episodes if e.task == task})
        delays = [environment.get(f"{name}_delay_s", 0.0) for name in ("action", "observation")]
        return [
            StationInfo(
                suite.nominal, task_of(task), 1e3 * each, 1.0 / suite.control_rate_hz, *delays
            )
            for each in dict.fromkeys((kpa[0], kpa[len(kpa) // 2], kpa[-1]))
        ]


def read_leaderboard(suite: FrozenSuite, folder: Path, bounds: Bounds | None = None) -> Leaderboard:
    """The leaderboard of the results in a folder.

    Args:
        suite: the suite.
        folder: of the results.
        bounds: achievable bounds on the suite's model.
    Raises:
        SuiteError: there are none, or they are of another suite or version.
    """
    info, rows = read_run(folder), finished_rows(folder)
    if not rows:
        raise SuiteError(
            f"{folder} has no results of suite {suite.name}; make some: "
            f"{run_command(suite, folder)}"
        )
    ran = info.get("suite", {})
    if (ran.get("name"), ran.get("digest")) != (suite.name, suite.digest):
        raise SuiteError(
            f"{folder} has results of suite {ran.get('name')} version {ran.get('version')} with "
            f"other numbers than {suite.source} version {suite.version} has now; run it again: "
            f"{run_command(suite, folder)}"
        )
    check_run(folder, info, suite.source)
    return Leaderboard(SuiteRecord.of(suite, rows), info, bounds)


def keep_bounds(suite: FrozenSuite, folder: Path) -> None:
    """Compute the achievable bounds that the targets need, and keep them for the page."""
    _ = read_leaderboard(suite, folder, Bounds(suite.model, folder)).verdicts
