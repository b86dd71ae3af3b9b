"""Results of a run, as rows and as files that appear whole or not at all."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import Any

from benchmarks.files import csv_text
from benchmarks.runner.case import Case, Row, cases
from benchmarks.runner.execution import identity, row_identity
from benchmarks.runner.phase_score import PHASES, UNITS, PhaseScore, measured_score
from benchmarks.suites.reproduction import ReproductionSuite
from pma_gym.data.trial import Trial

SCHEMA = 1
FIGURES = tuple(entry.name for entry in fields(PhaseScore))
CSV_COLUMNS = (
    *("model", "controller", "task", "pressure_kpa", "phase", "unit", "seed"),
    *FIGURES,
    "failure",
)
"""Columns of scores.csv; figures are in the row's unit: slope in unit/s, squares in unit^2."""


@dataclass(frozen=True)
class Score:
    """A case and its figures.

    Attributes:
        case: what was run.
        seed: of its episode.
        phases: figures by phase; none if it failed.
        failure: why it has no figures; empty if it has.
        times: control steps that it took (`steps`), time inside them (`step_seconds`, s) and of
            the whole case (`seconds`, s); empty if it failed.
    """

    case: Case
    seed: int
    phases: Mapping[str, PhaseScore]
    failure: str
    times: Mapping[str, float]

    @classmethod
    def of(cls, case: Case, row: Row) -> "Score":
        """A row of the journal."""
        phases = {name: PhaseScore(**figures) for name, figures in row.get("lines", {}).items()}
        return cls(case, row["seed"], phases, row["failure"], row.get("times", {}))

    @property
    def key(self) -> tuple[str, str, str, float]:
        """Model, controller, task and pressure (kPa)."""
        episode = self.case.episode
        return self.model, self.case.spec.name, episode.task, episode.pressure_kpa

    @property
    def model(self) -> str:
        """Name or path of the model."""
        suite = self.case.suite
        assert isinstance(suite, ReproductionSuite)
        return suite.models[self.case.episode.station]


def scores_of(suite: ReproductionSuite, rows: Iterable[Row]) -> list[Score]:
    """Scores in the order of the results: models, controllers, tasks, pressures."""
    by_case = {row_identity(row): row for row in rows}
    order = {entry.spec.name: at for at, entry in enumerate(suite.entries)}
    planned = sorted(
        cases(suite, suite.entries), key=lambda case: (case.episode.station, order[case.spec.name])
    )
    return [Score.of(case, by_case[its]) for case in planned if (its := identity(case)) in by_case]


@dataclass(frozen=True)
class Results:
    """A run of a suite.

    Attributes:
        suite: what was run.
        scores: of its cases, in the suite's order.
        info: versions, commit, machine, times.
        bounds: smallest RMSE (deg) achievable in phase III of rotation, by pressure (kPa).
        bound_failures: why others have none, by pressure (kPa).
        pictured: trials that are drawn, by controller, task and pressure (kPa).
    """

    suite: ReproductionSuite
    scores: Sequence[Score] = ()
    info: Mapping[str, Any] = field(default_factory=dict)
    bounds: Mapping[float, float] = field(default_factory=dict)
    bound_failures: Mapping[float, str] = field(default_factory=dict)
    pictured: Mapping[tuple[str, str, float], Trial] = field(default_factory=dict)

    @property
    def failures(self) -> list[tuple[str, str]]:
        """Name and reason of every case or bound that has no figures."""
        failed = [(score.case.name, score.failure) for score in self.scores if score.failure]
        bounds = self.bound_failures.items()
        return failed + [(f"achievable bound at {p:g} kPa", why) for p, why in bounds]

    def failure_reasons(self) -> list[tuple[str, str]]:
        """Each reason of failures once, after the first name that it struck and how many more."""
        names: dict[str, list[str]] = {}
        for name, reason in self.failures:
            names.setdefault(reason, []).append(name)
        return [
            (f"{struck[0]} and {len(struck) - 1} more" if len(struck) > 1 else struck[0], reason)
            for reason, struck in names.items()
        ]

    @cached_property
    def _phases(self) -> dict[tuple[str, str, str, float, str], PhaseScore]:
        return {
            (*score.key, phase): figures
            for score in self.scores
            for phase, figures in score.phases.items()
        }

    def phase(
        self, model: str, controller: str, task: str, pressure: float, phase: str
    ) -> PhaseScore | None:
        """Figures of one phase of one case; None if there are none."""
        return self._phases.get((model, controller, task, pressure, phase))

    def trials(self, task: str, pressure: float) -> dict[str, Trial]:
        """The trials of the first model that are drawn, by controller."""
        return {
            entry.spec.name: self.pictured[key]
            for entry in self.suite.entries
            if (key := (entry.spec.name, task, pressure)) in self.pictured
        }


def scores_csv(scores: Iterable[Score]) -> str:
    """A row for each phase of each case; a failed case has one row with its failure."""
    cells: list[Sequence[object]] = [CSV_COLUMNS]
    for score in scores:
        model, controller, task, pressure = score.key
        head = [model, controller, task, f"{pressure:g}"]
        for phase, figures in score.phases.items():
            row = [*head, phase, UNITS[task], score.seed]
            cells.append([*row, *(repr(getattr(figures, name)) for name in FIGURES), ""])
        if score.failure:
            blank = [""] * len(FIGURES)
            cells.append([*head, "", UNITS[task], score.seed, *blank, score.failure])
    return csv_text(cells)


def json_text(results: Results, **more: object) -> str:
    """All results of the run, with what it was made of.

    Args:
        results: the run.
        more: further entries: targets, replay...
    """
    suite = results.suite
    document = {
        "schema": SCHEMA,
        "complete": True,
        "suite": {
            "name": suite.name,
            "version": suite.version,
            "selected": suite.selected,
            "seed": suite.seed,
            "control_rate_hz": suite.control_rate_hz,
            "noise": suite.noise,
            "models": suite.models,
            "controllers": [asdict(controller) for controller in suite.controllers],
            "pressures_kpa": suite.pressures_kpa,
        },
        "run": results.info,
        **more,
        "scores": [_entry(score) for score in results.scores],
        "measured": _measured(suite),
        "achievable_rmse_phase_iii_deg": {f"{p:g}": b for p, b in results.bounds.items()},
    }
    return json.dumps(_finite(document), indent=1, allow_nan=False) + "\n"


def _entry(score: Score) -> dict[str, object]:
    model, controller, task, pressure = score.key
    return {
        "model": model,
        "controller": controller,
        "task": task,
        "pressure_kpa": pressure,
        "unit": UNITS[task],
        "seed": score.seed,
        "failure": score.failure or None,
        "phases": {phase: asdict(figures) for phase, figures in score.phases.items()},
    }


def _measured(suite: ReproductionSuite) -> list[dict[str, object]]:
    """The dissertation's own trials, as far as the suite repeats them."""
    return [
        {
            "task": task,
            "pressure_kpa": pressure,
            "unit": UNITS[task],
            "phases": {
                phase: asdict(measured_score(task, phase, pressure)) for phase in PHASES[task]
            },
        }
        for task, pressures in suite.pressures_kpa.items()
        for pressure in pressures
    ]


def _finite(value: object) -> object:
    """The value without NaN and infinity, which JSON does not have."""
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
