"""A trial's rows of tables 20-22 or 24-30: regression, analysis of variance and RMSE by phase."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.stats import f as f_distribution

from pma_gym.data.trial import Trial, TrialError
from pma_gym.data.trial_schedule import SCHEDULES, Phase, TrialSchedule
from pma_gym.metrics import (
    PHASE_SAMPLES,
    SAMPLE_RATE_HZ,
    Regression,
    percent_of_range,
    phase_times,
    regression,
    rmse,
)
from pma_gym.pages.document import Paragraph, TextTable
from pma_gym.pages.figures import notebook_html
from pma_gym.units import SI_FACTORS

LONGEST_GAP = 0.2
"""Longest time between two measured samples that is bridged by a line (s).

The dissertation's commands are printed every 0.2 s; a longer gap can hide what one of them did."""

_SAME_TIME = 1e-5
"""Distance from the grid below which a sample counts as on it (s); logs round their times."""


@dataclass(frozen=True)
class Evaluation:
    """One phase of one trial; in SI, a table's units where it is printed.

    Attributes:
        schedule: phases and ideal reference of the task.
        phase: the phase of it.
        regression: line through the position (m or rad) on the phase's own time (s).
        rmse: root mean square error against the ideal (m or rad).
        note: what was done to the samples before; empty if nothing.
    Source:
        Serres 2008, tables 20-22 (displacement), 24-30 (rotation).
    """

    schedule: TrialSchedule
    phase: Phase
    regression: Regression
    rmse: float
    note: str = ""

    @property
    def percent_of_range(self) -> float:
        """RMSE in percent of the task's range, 25 mm or 90 deg."""
        return percent_of_range(self.rmse, self.schedule.span)

    @property
    def p_value(self) -> float:
        """Chance of such an F ratio if the position did not depend on time."""
        return float(f_distribution.sf(self.regression.f_ratio, 1, self.regression.error_dof))


class Evaluations(list[Evaluation]):
    """A trial's phases, in order."""

    @property
    def title(self) -> str:
        """Heading: the kind of trial that was scored."""
        return f"Isokinetic {self[0].schedule.name}" if self else "No phases"

    def documents(self) -> list[dict[str, float | int | str]]:
        """A dictionary a phase, figures in the task's unit in files, all digits."""
        return [_document(row) for row in self]

    def rows(self) -> list[list[str]]:
        """Rows of the dissertation's table: a label, then a figure a phase."""
        by_phase = [_figures(row) for row in self]
        return [
            [figures[0][0], *(text for _, text in figures)]
            for figures in zip(*by_phase, strict=True)
        ]

    def notes(self) -> list[str]:
        """Changes to the samples, by phase; empty if there were none."""
        texts = dict.fromkeys(row.note for row in self if row.note)
        named = {text: ", ".join(r.phase.name for r in self if r.note == text) for text in texts}
        return [f"{phases}: {text}" for text, phases in named.items()]

    def _repr_html_(self) -> str:
        """Notebook display: the table, and the changes to the samples."""
        table = TextTable(self.title, ["Phase", *(row.phase.name for row in self)], self.rows())
        return notebook_html([table, *map(Paragraph, self.notes())])


def evaluate(trial: Trial, task: str = "displacement", use_truth: bool = False) -> Evaluations:
    """Judge a trial as the dissertation judged its own.

    Each phase is sampled at 384 Hz for 1923 samples; a log on other times is interpolated
    linearly between its measured samples, and its row says so. Phases count from the trial's
    first sample. Extension counts from the contraction at the first sample; rotation is taken as
    logged, 0 at the start.

    Args:
        trial: measured, simulated or from a rollout.
        task: "displacement" (extension, one phase) or "rotation" (three phases).
        use_truth: judge the simulated position itself, not what the sensors said of it.
    Returns:
        A row for each phase, in order.
    Raises:
        TrialError: unknown task, position not in the trial, log too short or with a gap too long.
    """
    if task not in SCHEDULES:
        raise TrialError(f"task must be one of {', '.join(SCHEDULES)}, got {task!r}")
    schedule = SCHEDULES[task]
    position = _position(trial, schedule, use_truth)
    measured = ~np.isnan(position)
    time = trial.time - trial.time[0]
    known = time[measured], position[measured]
    return Evaluations(_row(schedule, phase, *known) for phase in schedule.phases)


def print_evaluation(rows: Evaluations, console: Console) -> None:
    """Print rows as tables 20-22 or 24-30 have them, in mm or deg.

    Args:
        rows: what `evaluate` returned.
        console: where to.
    """
    if not rows:
        return
    table = Table("Phase", title=rows.title)
    for row in rows:
        table.add_column(row.phase.name, justify="right")
    for cells in rows.rows():
        table.add_row(*cells)
    console.print(table)
    for note in rows.notes():
        console.print(note, highlight=False)


def _position(trial: Trial, schedule: TrialSchedule, use_truth: bool) -> NDArray[np.float64]:
    """The position that the task asks for (m or rad), shape of the trial's time."""
    if not use_truth:
        return trial.extension if schedule.followed.lengthens else trial.rotation
    if schedule.quantity not in trial.truth:
        raise TrialError(
            f"the trial has no true {schedule.quantity}: only a simulation's Trial has it, a file "
            "does not; judge the measured one with use_truth=False"
        )
    return trial.truth[schedule.quantity]


def _row(
    schedule: TrialSchedule, phase: Phase, time: NDArray[np.float64], position: NDArray[np.float64]
) -> Evaluation:
    """The row of one phase, from measured samples only."""
    grid = _grid(schedule, phase, time)
    sampled = np.interp(phase.start + grid, time, position)
    return Evaluation(
        schedule=schedule,
        phase=phase,
        regression=regression(grid, sampled),
        rmse=rmse(sampled - phase.reference(grid)),
        note=_note(phase, grid, time),
    )


def _grid(schedule: TrialSchedule, phase: Phase, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """The phase's own times that the log covers (s), at least up to its nominal end."""
    end = phase.start + phase.duration
    last = float(time[-1]) if time.size else 0.0
    # A log of the nominal length lacks the two samples that outlast the phase.
    if last < end - 1.0 / SAMPLE_RATE_HZ:
        raise TrialError(
            f"phase {phase.name} of the {schedule.name} task needs {schedule.quantity} up to "
            f"{end:g} s, the trial's last measured sample is at {last:.4g} s; "
            "log the whole task, or choose the task that was run"
        )
    own = phase_times()
    own = own[phase.start + own <= last + _SAME_TIME]
    _check_gaps(schedule, phase.start + own, time)
    return own


def _check_gaps(
    schedule: TrialSchedule, instants: NDArray[np.float64], time: NDArray[np.float64]
) -> None:
    """Refuse a phase that the log does not cover closely enough."""
    first = np.searchsorted(time, instants[0], side="right")
    last = np.searchsorted(time, instants[-1], side="left")
    # 0 stands for the trial's start, where an empty cell would be bridged too.
    known = np.concatenate(([0.0], time))[first : last + 2]
    gaps = np.diff(known)
    widest = int(np.argmax(gaps))
    if gaps[widest] > LONGEST_GAP + _SAME_TIME:
        raise TrialError(
            f"{schedule.quantity} must be measured at least every {LONGEST_GAP:g} s, the trial has "
            f"nothing for {gaps[widest]:.3g} s from {known[widest]:.4g} s on; log it more often"
        )


def _note(phase: Phase, grid: NDArray[np.float64], time: NDArray[np.float64]) -> str:
    """What was done to the samples; nothing if the log has exactly the wanted ones."""
    notes = []
    nearest = np.interp(phase.start + grid, time, np.arange(time.size)).round().astype(int)
    if np.max(np.abs(time[nearest] - phase.start - grid)) > _SAME_TIME:
        notes.append(
            f"interpolated linearly to {SAMPLE_RATE_HZ:g} Hz from samples "
            f"{np.median(np.diff(time)):.3g} s apart"
        )
    if grid.size < PHASE_SAMPLES:
        notes.append(
            f"{grid.size} of {PHASE_SAMPLES} samples, for the trial ends at {time[-1]:.4g} s"
        )
    return "; ".join(notes)


def _figures(row: Evaluation) -> list[tuple[str, str]]:
    """Labels and figures of the row, in the task's unit in files."""
    line, unit = row.regression, row.schedule.unit
    factor = SI_FACTORS[unit]
    chance = "<0.0001" if row.p_value < 1e-4 else f"{row.p_value:.4f}"
    return [
        (f"Slope ({unit}/s)", _text(line.slope / factor)),
        ("  standard error", _text(line.slope_std_error / factor)),
        ("  t ratio", _text(line.slope_t_ratio)),
        (f"Intercept ({unit})", _text(line.intercept / factor)),
        ("  standard error", _text(line.intercept_std_error / factor)),
        ("  t ratio", _text(line.intercept_t_ratio)),
        (f"Sum of squares, model ({unit}^2)", _text(line.ss_model / factor**2)),
        (f"Sum of squares, error ({unit}^2)", _text(line.ss_error / factor**2)),
        (f"Mean square, error ({unit}^2)", _text(line.residual_mean_square / factor**2)),
        ("F ratio", _text(line.f_ratio)),
        ("Prob > F", chance),
        (f"RMSE ({unit})", _text(row.rmse / factor)),
        ("RMSE (% of range)", _text(row.percent_of_range)),
        ("Samples", str(line.n)),
    ]


def _document(row: Evaluation) -> dict[str, float | int | str]:
    """The row's figures by name with unit."""
    line, unit, suffix = row.regression, row.schedule.unit, row.schedule.suffix
    factor = SI_FACTORS[unit]
    return {
        "task": row.schedule.name,
        "phase": row.phase.name,
        f"rmse_{suffix}": row.rmse / factor,
        "rmse_percent_of_range": row.percent_of_range,
        f"slope_{suffix}_per_s": line.slope / factor,
        f"slope_std_error_{suffix}_per_s": line.slope_std_error / factor,
        f"intercept_{suffix}": line.intercept / factor,
        f"intercept_std_error_{suffix}": line.intercept_std_error / factor,
        f"ss_model_{suffix}2": line.ss_model / factor**2,
        f"ss_error_{suffix}2": line.ss_error / factor**2,
        "f_ratio": line.f_ratio,
        "p_value": row.p_value,
        "samples": line.n,
        "note": row.note,
    }


def _text(figure: float) -> str:
    """Six digits, and the millions of a sum of squares written out."""
    return f"{figure:.0f}" if 1e6 <= abs(figure) < 1e9 else f"{figure:.6g}"
