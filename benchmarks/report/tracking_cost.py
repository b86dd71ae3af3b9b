"""Costs of tracking: start and steady errors, effort, limits, computing time."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.report.errors import Measure, SuiteRecord

MICROSECONDS = 1e6
"""Microseconds in a second."""


class Spending(NamedTuple):
    """Medians over the cases that a controller did not fail in; all NaN if it failed in all.

    Attributes:
        name: of the controller.
        cases: how many cases it has.
        failures: how many of them failed.
        start: RMSE of the first 0.5 s (the task's unit).
        steady: RMSE of the rest.
        largest: largest error of all phases.
        effort_v: standard deviation of the voltage (V).
        variation_v_per_s: total variation of the voltage (V/s).
        saturated_percent: mean share of the control steps at 0 or 10 V (%).
        clipped_percent: mean share of the control steps whose command, below 0 V or above 10 V,
            was clipped (%).
        clipped_v: how far beyond 0-10 V a command of any case was (V).
        violating_percent: share of the cases that passed a soft limit (%).
        violation_percent: the largest violation of any case (% of the way to the hard limit).
        act_us: computing time of `act` (us).
        act_us_worst: its 99th percentile (us).
        real_time_factor: how often `act` fits into a control period, at that percentile.
    """

    name: str
    cases: int
    failures: int
    start: float
    steady: float
    largest: float
    effort_v: float
    variation_v_per_s: float
    saturated_percent: float
    clipped_percent: float
    clipped_v: float
    violating_percent: float
    violation_percent: float
    act_us: float
    act_us_worst: float
    real_time_factor: float


def spending(record: SuiteRecord, measure: Measure, names: Sequence[str]) -> list[Spending]:
    """Return the costs of each controller in a measure's tasks."""
    return [_of_one(record, measure, name) for name in names]


def _of_one(record: SuiteRecord, measure: Measure, name: str) -> Spending:
    rows = [
        row
        for (who, episode), row in record.rows.items()
        if who == name and episode.task in measure.tasks
    ]
    done = [row for row in rows if not row["failure"]]

    def column(field: str) -> np.ndarray:
        return np.array([row.get(field, np.nan) for row in done] or [np.nan], dtype=np.float64)

    largest = [max(phase["largest_error"] for phase in row["phases"].values()) for row in done]
    worst_us = float(np.median(column("act_us_worst")))
    period_us = MICROSECONDS / record.suite.control_rate_hz
    return Spending(
        name=name,
        cases=len(rows),
        failures=len(rows) - len(done),
        start=float(np.median(column("start_rmse"))),
        steady=float(np.median(column("steady_rmse"))),
        largest=float(np.median(largest)) if largest else np.nan,
        effort_v=float(np.median(column("effort_v"))),
        variation_v_per_s=float(np.median(column("variation_v_per_s"))),
        saturated_percent=100.0 * float(np.mean(column("saturation_share"))),
        clipped_percent=100.0 * float(np.mean(column("clipped_share"))),
        clipped_v=float(np.max(column("clipped_v"))),
        violating_percent=100.0 * float(np.mean(column("violation") > 0.0)) if done else np.nan,
        violation_percent=100.0 * float(np.max(column("violation"))),
        act_us=float(np.median(column("act_us"))),
        act_us_worst=worst_us,
        real_time_factor=period_us / worst_us,
    )
