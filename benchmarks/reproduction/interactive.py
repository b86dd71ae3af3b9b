"""The report's figures to zoom, hover and filter: RMSE by pressure, trials, the replay's errors."""

from collections.abc import Iterator
from math import ceil, nan

import numpy as np
from numpy.typing import NDArray

from benchmarks.report.plot_style import controller_styles
from benchmarks.reproduction.plots import (
    LABELS,
    QUANTITY_LABELS,
    measured_lines,
    pictured_pressures,
)
from benchmarks.reproduction.replay import QUANTITIES, all_replay_errors
from benchmarks.reproduction.results import Results
from benchmarks.runner.phase_score import PHASES, UNITS, measured_score
from pma_gym.data.trial import Trial
from pma_gym.data.trial_schedule import SCHEDULES
from pma_gym.pages.interactive import InteractiveFigure, Trace
from pma_gym.units import SI_FACTORS

MOST_POINTS = 60_000
"""Points of the trials of a task, so that a page stays below 5 MB however many controllers ran."""

_CURVE_POINTS = 480
_VIEWS = 3
_MEASURED = "#8a8f98"
_PHASES = {"displacement": "#0072B2", "I": "#0072B2", "II": "#E69F00", "III": "#009E73"}
_HOW = "Hover for values; click a name to hide it; drag to zoom, double-click to zoom out."

Values = NDArray[np.float64]


def rmse_figure(results: Results, task: str) -> InteractiveFigure:
    """RMSE by pressure of everybody: a view a phase."""
    suite, unit = results.suite, UNITS[task]
    pressures = suite.pressures_kpa[task]
    traces = []
    for phase in PHASES[task]:
        view = f"RMSE ({unit})" if len(PHASES[task]) == 1 else f"RMSE in phase {phase} ({unit})"
        measured = [measured_score(task, phase, pressure).rmse for pressure in pressures]
        traces.append(Trace("Measured", pressures, measured, _MEASURED, view=view))
        for name, style in controller_styles(suite).items():
            scores = [results.phase(suite.models[0], name, task, p, phase) for p in pressures]
            values = [score.rmse if score else nan for score in scores]
            traces.append(Trace(style.label, pressures, values, style.color, view=view))
        if phase == "III" and results.bounds:
            values = [results.bounds.get(p, nan) for p in pressures]
            traces.append(Trace("Achievable bound", pressures, values, view=view))
    caption = f"RMSE by pressure, on a logarithmic scale. {_HOW}"
    return InteractiveFigure(f"rmse-{task}", caption, "pressure (kPa)", "", traces, True)


def tracking_figure(results: Results, task: str) -> InteractiveFigure:
    """Error, response and motor voltage of the pictured trials: a view each at each pressure."""
    pressures = pictured_pressures(results, task)
    curves = _VIEWS * sum(len(results.trials(task, pressure)) for pressure in pressures)
    points = max(2, min(_CURVE_POINTS, MOST_POINTS // curves))
    traces = [
        trace for pressure in pressures for trace in _trial_traces(results, task, pressure, points)
    ]
    caption = (
        f"The trials at {', '.join(f'{p:g}' for p in pressures)} kPa. {_HOW} "
        f"A curve has {points} of a trial's samples."
    )
    return InteractiveFigure(f"tracking-{task}", caption, "time (s)", "", traces)


def replay_figure(results: Results) -> InteractiveFigure:
    """Signed errors of the replay by pressure: a view a quantity of a task, a curve a phase."""
    errors = all_replay_errors(results, results.suite.models[0])
    traces = []
    for task in dict.fromkeys(task for task, _ in errors):
        for quantity in QUANTITIES:
            label = QUANTITY_LABELS[quantity].format(unit=UNITS[task])
            for phase in (phase for its_task, phase in errors if its_task == task):
                trials = errors[task, phase]
                name = phase if phase == task else f"phase {phase}"
                x = [trial.pressure_kpa for trial in trials]
                y = [getattr(trial, quantity) for trial in trials]
                traces.append(Trace(name, x, y, _PHASES[phase], view=f"{task}: {label}"))
    caption = f"Simulated less measured, trial by trial. {_HOW}"
    return InteractiveFigure("replay-errors", caption, "pressure (kPa)", "", traces)


def _trial_traces(results: Results, task: str, pressure: float, points: int) -> Iterator[Trace]:
    """The three views of a pressure: the dissertation's lines, then every controller."""
    schedule, unit = SCHEDULES[task], UNITS[task]
    views = [
        f"{quantity} at {pressure:g} kPa ({its_unit})"
        for quantity, its_unit in (("error", unit), (LABELS[task], unit), ("motor voltage", "V"))
    ]
    grid = np.linspace(0.0, schedule.duration, 61)
    ideal = schedule.reference(grid) / SI_FACTORS[unit]
    yield Trace("Ideal", grid.tolist(), np.zeros(grid.size).tolist(), view=views[0])
    yield Trace("Ideal", grid.tolist(), ideal.tolist(), view=views[1])
    lines = measured_lines(task, pressure)
    time = _joined([time for time, _ in lines])
    line = _joined([line for _, line in lines])
    error = line - schedule.reference(time) / SI_FACTORS[unit]
    yield Trace("Measured (lines)", time.tolist(), error.tolist(), _MEASURED, view=views[0])
    yield Trace("Measured (lines)", time.tolist(), line.tolist(), _MEASURED, view=views[1])
    styles = controller_styles(results.suite)
    for name, trial in results.trials(task, pressure).items():
        curves = _curves(trial, task, points)
        for view, values in zip(views, curves[1:], strict=True):
            label, color = styles[name].label, styles[name].color
            yield Trace(label, curves[0].tolist(), values.tolist(), color, view=view)


def _curves(trial: Trial, task: str, points: int) -> tuple[Values, Values, Values, Values]:
    """Time (s), error and position (file unit) and motor voltage (V) of a trial, thinned out."""
    schedule = SCHEDULES[task]
    some = slice(None, None, ceil(trial.time.size / points))
    time, unit = trial.time[some], SI_FACTORS[UNITS[task]]
    position = trial.truth[schedule.quantity][some] / unit
    ideal = schedule.reference(time) / unit
    return time, position - ideal, position, trial.commands["motor_voltage"][some]


def _joined(parts: list[Values]) -> Values:
    """Curves one after the other, with a gap after each."""
    return np.concatenate([np.append(part, nan) for part in parts])
