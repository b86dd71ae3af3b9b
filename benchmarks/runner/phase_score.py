"""A trial's figures, phase by phase, and the dissertation's own beside them."""

from dataclasses import dataclass

import numpy as np

from pma_gym.data.serres2008 import load_table
from pma_gym.data.trial import Trial
from pma_gym.data.trial_schedule import SCHEDULES
from pma_gym.metrics import PHASE_DURATION, Regression, line_error, percent_of_range
from pma_gym.studies.evaluation import evaluate
from pma_gym.studies.trials import TRIALS, measured_regression
from pma_gym.tasks import phase_errors
from pma_gym.units import SI_FACTORS

PHASES = {
    task: tuple(phase.name for phase in schedule.phases) for task, schedule in SCHEDULES.items()
}
"""Phases of each task, as the tables call them."""

UNITS = {task: schedule.unit for task, schedule in SCHEDULES.items()}
"""Unit of each task's position in file units."""


@dataclass(frozen=True)
class PhaseScore:
    """Figures of one phase in the task's unit (mm or deg), as tables 20-22 and 24-30 have them.

    Attributes:
        slope: of the least-squares line (unit/s).
        slope_std_error: its standard error (unit/s).
        intercept: of the line, at the phase's own time 0 (unit).
        intercept_std_error: its standard error (unit).
        ss_model: sum of squares of the line (unit^2).
        ss_error: sum of squares about the line (unit^2).
        residual_mean_square: ss_error / (n - 2) (unit^2).
        rmse: against the ideal (unit); its square is that of the next two together.
        line_error: rms over the phase of the line less the ideal (unit).
        scatter: rms about the line (unit).
        percent_of_range: the RMSE in percent of 25 mm or 90 deg.
        largest_error: largest distance from the ideal (unit); None for a printed trial.
    """

    slope: float
    slope_std_error: float
    intercept: float
    intercept_std_error: float
    ss_model: float
    ss_error: float
    residual_mean_square: float
    rmse: float
    line_error: float
    scatter: float
    percent_of_range: float
    largest_error: float | None = None

    @property
    def mean(self) -> float:
        """Position in the middle of the phase, on the line: its mean over the 5 s (unit)."""
        return self.intercept + self.slope * PHASE_DURATION / 2.0


def score_trial(trial: Trial, task: str) -> dict[str, PhaseScore]:
    """Figures of a simulated trial's true motion.

    Args:
        trial: with truth, on the 384 Hz grid.
        task: `displacement` or `rotation`.
    Returns:
        Figures by phase.
    Raises:
        TrialError: the trial does not last to the task's end.
    """
    schedule = SCHEDULES[task]
    unit = SI_FACTORS[schedule.unit]
    errors = phase_errors(schedule, np.asarray(trial.truth[schedule.quantity]))
    return {
        row.phase.name: _figures(
            row.regression,
            (row.phase.slope, row.phase.initial),
            row.rmse,
            row.percent_of_range,
            unit,
            float(np.max(np.abs(errors[row.phase.name]))) / unit,
        )
        for row in evaluate(trial, task, use_truth=True)
    }


def measured_score(task: str, phase: str, pressure_kpa: float) -> PhaseScore:
    """Figures of the dissertation's own trial, as printed (misprints corrected).

    Source:
        Serres 2008, tables 20-22 and 24-30.
    """
    tables = next(trial for trial in TRIALS if trial.phase == phase)
    name, rmse_column, _ = tables.errors
    rmse = float(load_table(name).where(pressure_kpa=pressure_kpa)[rmse_column][0])
    span = SCHEDULES[task].span / SI_FACTORS[UNITS[task]]
    line = measured_regression(phase, pressure_kpa)
    return _figures(line, tables.ideal, rmse, percent_of_range(rmse, span), 1.0)


def _figures(
    line: Regression,
    ideal: tuple[float, float],
    rmse: float,
    percent: float,
    unit: float,
    largest: float | None = None,
) -> PhaseScore:
    """Figures of a line in a unit (its value in the line's own); the largest error is in it.

    The ideal is a slope and an intercept in the line's own unit.
    """
    return PhaseScore(
        slope=line.slope / unit,
        slope_std_error=line.slope_std_error / unit,
        intercept=line.intercept / unit,
        intercept_std_error=line.intercept_std_error / unit,
        ss_model=line.ss_model / unit**2,
        ss_error=line.ss_error / unit**2,
        residual_mean_square=line.residual_mean_square / unit**2,
        rmse=rmse / unit,
        line_error=line_error(line, *ideal) / unit,
        scatter=line.scatter / unit,
        percent_of_range=percent,
        largest_error=largest,
    )
