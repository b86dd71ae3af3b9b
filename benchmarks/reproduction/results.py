"""Results of a run, as rows and as files that appear whole or not at all."""

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import Any

from benchmarks.reproduction.execution import Execution
from benchmarks.reproduction.score import PHASES, UNITS, PhaseScore, Score, measured_score
from benchmarks.suites.reproduction import Suite
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
class Results:
    """A run of a suite.

    Attributes:
        suite: what was to be run.
        execution: what became of its cases, and the bounds.
        info: versions, commit, machine, times.
    """

    suite: Suite
    execution: Execution
    info: Mapping[str, Any]

    @property
    def complete(self) -> bool:
        """Whether every case of the suite was run."""
        return self.execution.complete

    @property
    def bounds(self) -> dict[float, float]:
        """Smallest RMSE (deg) achievable in phase III of rotation, by pressure (kPa)."""
        bounds = self.execution.bounds.items()
        return {p: bound.rmse_deg for p, bound in bounds if bound.rmse_deg is not None}

    @cached_property
    def scores(self) -> list[Score]:
        """Scores in the suite's order."""
        return [outcome.score for outcome in self.execution.outcomes]

    @property
    def failures(self) -> list[tuple[str, str]]:
        """Name and reason of every case or bound that has no figures."""
        cases = [(score.case.name, score.failure) for score in self.scores if score.failure]
        bounds = [(b.name, b.failure) for b in self.execution.bounds.values() if b.failure]
        return cases + bounds

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
            (s.case.model, s.case.controller.name, s.case.task, s.case.pressure_kpa, phase): figures
            for s in self.scores
            for phase, figures in s.phases.items()
        }

    def phase(
        self, model: str, controller: str, task: str, pressure: float, phase: str
    ) -> PhaseScore | None:
        """Figures of one phase of one case; None if there are none."""
        return self._phases.get((model, controller, task, pressure, phase))

    def trials(self, task: str, pressure: float) -> dict[str, Trial]:
        """The kept trials of the first model, by controller."""
        return {
            outcome.score.case.controller.name: outcome.trial
            for outcome in self.execution.outcomes
            if outcome.trial is not None
            and (outcome.score.case.task, outcome.score.case.pressure_kpa) == (task, pressure)
        }


def csv_text(scores: Iterable[Score]) -> str:
    """A row for each phase of each case; a failed case has one row with its failure."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for score in scores:
        case = score.case
        head = [case.model, case.controller.name, case.task, f"{case.pressure_kpa:g}"]
        for phase, figures in score.phases.items():
            row = [*head, phase, UNITS[case.task], score.seed]
            writer.writerow([*row, *(repr(getattr(figures, name)) for name in FIGURES), ""])
        if score.failure:
            blank = [""] * len(FIGURES)
            writer.writerow([*head, "", UNITS[case.task], score.seed, *blank, score.failure])
    return out.getvalue()


def json_text(results: Results, **more: object) -> str:
    """All results of the run, with what it was made of.

    Args:
        results: the run.
        more: further entries: targets, replay...
    """
    suite = results.suite
    document = {
        "schema": SCHEMA,
        "complete": results.complete,
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
    case = score.case
    return {
        "model": case.model,
        "controller": case.controller.name,
        "task": case.task,
        "pressure_kpa": case.pressure_kpa,
        "unit": UNITS[case.task],
        "seed": score.seed,
        "failure": score.failure or None,
        "phases": {phase: asdict(figures) for phase, figures in score.phases.items()},
    }


def _measured(suite: Suite) -> list[dict[str, object]]:
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
