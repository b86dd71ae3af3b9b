"""The report's figures: as pictures, and to zoom, hover and filter.

Reference and response, error, voltage, actual against ideal; RMSE by pressure, the replay's errors.
"""

from collections.abc import Iterator, Sequence
from math import ceil, nan
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from benchmarks.report.plots import BOUND, MEASURED, REFERENCE, Style, controller_styles
from benchmarks.reproduction.replay import QUANTITIES, all_replay_errors
from benchmarks.reproduction.results import Results
from benchmarks.runner.phase_score import PHASES, UNITS, measured_score
from pma_gym.data.trial import Trial
from pma_gym.data.trial_schedule import SCHEDULES, TrialSchedule
from pma_gym.metrics import phase_times
from pma_gym.pages.figures import Plot, legend_below, picture
from pma_gym.pages.interactive import InteractiveFigure, Trace
from pma_gym.units import SI_FACTORS

_GREY = "#666666"
QUANTITY_LABELS = {
    "slope": "slope ({unit}/s)",
    "intercept": "intercept ({unit})",
    "mean": "mean position ({unit})",
    "rmse": "RMSE ({unit})",
    "line_error": "line part ({unit})",
    "scatter": "scatter ({unit})",
}
"""What the errors of a replay are called; `unit` is mm or deg."""


def rmse_plot(results: Results, task: str) -> Plot:
    """RMSE of every controller at every pressure of a task, measured beside it."""
    suite = results.suite
    pressures = suite.pressures_kpa[task]
    phases = PHASES[task]
    styles = controller_styles(suite)
    with picture(11.0, 1.0 + 2.8 * len(phases)) as figure:
        axes: Any = figure.subplots(len(phases), 1, sharex=True, sharey=True, squeeze=False)
        for axis, phase in zip(axes[:, 0], phases, strict=True):
            measured = [measured_score(task, phase, pressure).rmse for pressure in pressures]
            axis.plot(pressures, measured, **MEASURED)
            for name, style in styles.items():
                scores = [results.phase(suite.models[0], name, task, p, phase) for p in pressures]
                values = [score.rmse if score else np.nan for score in scores]
                axis.plot(pressures, values, color=style.color, marker=style.marker, markersize=5.5)
            if phase == "III" and results.bounds:
                axis.plot(pressures, [results.bounds.get(p, np.nan) for p in pressures], **BOUND)
            axis.set_ylabel(f"RMSE ({UNITS[task]})")
            if len(phases) > 1:
                axis.set_title(f"phase {phase}", loc="left")
        # From 0.015 with feedback to 15 without: only a logarithm shows both.
        axes[0, 0].set_yscale("log")
        axes[0, 0].yaxis.set_major_formatter("{x:g}")
        axes[-1, 0].set_xticks(pressures, [f"{p:g}" for p in pressures])
        axes[-1, 0].set_xlabel("pressure (kPa)")
        handles = [
            Line2D([], [], label="Measured", **MEASURED),
            *(
                Line2D([], [], color=style.color, marker=style.marker, label=style.label)
                for style in styles.values()
            ),
        ]
        if "III" in phases and results.bounds:
            handles.append(Line2D([], [], label="Achievable bound", **BOUND))
        legend_below(figure, handles, min(len(handles), 6))
        return figure


_ENLARGED = {"displacement": 0.4, "rotation": 1.6}
"""Half the height of the enlarged error (mm, deg): four times what feedback is to reach."""

LABELS = {"displacement": "extension", "rotation": "rotation"}
"""What the position of a task is called."""


def tracking_plot(results: Results, task: str) -> Plot:
    """Response, error and motor voltage over time at a low, a middle and a high pressure."""
    pressures = pictured_pressures(results, task)
    styles = controller_styles(results.suite)
    unit = UNITS[task]
    with picture(11.0, 10.5) as figure:
        axes: Any = figure.subplots(4, len(pressures), sharex=True, sharey="row", squeeze=False)
        for column, pressure in enumerate(pressures):
            panels = axes[:, column]
            panels[0].set_title(f"{pressure:g} kPa")
            _draw_measured(panels, task, pressure)
            for name, trial in results.trials(task, pressure).items():
                _draw_trial(panels, trial, SCHEDULES[task], styles[name])
            panels[-1].set_xlabel("time (s)")
        axes[0, 0].set_ylabel(f"{LABELS[task]} ({unit})")
        axes[1, 0].set_ylabel(f"actual − ideal ({unit})")
        axes[2, 0].set(
            ylabel=f"actual − ideal ({unit}),\nenlarged", ylim=(-_ENLARGED[task], _ENLARGED[task])
        )
        axes[3, 0].set(ylabel="motor voltage (V)", ylim=(0.0, None))
        figure.align_ylabels()
        legend_below(figure, _handles(styles), 3)
        return figure


def actual_against_ideal_plot(results: Results, task: str) -> Plot:
    """Actual position over the ideal one, as figures 32 and 36 have it."""
    pressures = pictured_pressures(results, task)
    styles = controller_styles(results.suite)
    unit = UNITS[task]
    schedule = SCHEDULES[task]
    span = schedule.span / SI_FACTORS[unit]
    with picture(11.0, 4.6) as figure:
        axes: Any = figure.subplots(1, len(pressures), sharex=True, sharey=True, squeeze=False)
        for axis, pressure in zip(axes[0], pressures, strict=True):
            axis.set_title(f"{pressure:g} kPa")
            axis.plot([0.0, span], [0.0, span], zorder=4, **REFERENCE)
            for time, line in measured_lines(task, pressure):
                axis.plot(schedule.reference(time) / SI_FACTORS[unit], line, zorder=1, **MEASURED)
            for name, trial in results.trials(task, pressure).items():
                position = trial.truth[schedule.quantity] / SI_FACTORS[unit]
                ideal = schedule.reference(trial.time) / SI_FACTORS[unit]
                axis.plot(ideal, position, color=styles[name].color, zorder=2)
            axis.set_xlabel(f"ideal {LABELS[task]} ({unit})")
        axes[0, 0].set_ylabel(f"actual {LABELS[task]} ({unit})")
        legend_below(figure, _handles(styles), 3)
        return figure


def pictured_pressures(results: Results, task: str) -> list[float]:
    """The pressures that are drawn and have a trial."""
    return [p for p in results.suite.pictured_kpa[task] if results.trials(task, p)]


def _draw_trial(
    panels: Sequence[Axes], trial: Trial, schedule: TrialSchedule, style: Style
) -> None:
    response, error, enlarged, voltage = panels
    unit, color = SI_FACTORS[schedule.unit], style.color
    actual = trial.truth[schedule.quantity] / unit
    difference = actual - schedule.reference(trial.time) / unit
    response.plot(trial.time, actual, color=color)
    error.plot(trial.time, difference, color=color)
    enlarged.plot(trial.time, difference, color=color, linewidth=0.9)
    voltage.plot(trial.time, trial.commands["motor_voltage"], color=color, linewidth=0.9)


def _draw_measured(panels: Sequence[Axes], task: str, pressure: float) -> None:
    """The reference, and the lines of tables 21 and 27-29, which are all that is printed."""
    schedule, unit = SCHEDULES[task], SI_FACTORS[UNITS[task]]
    grid = np.linspace(0.0, schedule.duration, 301)
    panels[0].plot(grid, schedule.reference(grid) / unit, zorder=4, **REFERENCE)
    for panel in panels[1:3]:
        panel.axhline(0.0, zorder=4, **REFERENCE)
    for time, line in measured_lines(task, pressure):
        panels[0].plot(time, line, zorder=1, **MEASURED)
        panels[1].plot(time, line - schedule.reference(time) / unit, zorder=1, **MEASURED)


def measured_lines(
    task: str, pressure: float
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Times (s) and positions (unit) of the regression line of each phase."""
    lines = []
    own = phase_times()[:1921:8]
    for phase in SCHEDULES[task].phases:
        score = measured_score(task, phase.name, pressure)
        lines.append((phase.start + own, score.intercept + score.slope * own))
    return lines


def _handles(styles: dict[str, Style]) -> list[Line2D]:
    return [
        Line2D([], [], label="Ideal", **REFERENCE),
        Line2D([], [], label="Measured (regression lines)", **MEASURED),
        *(Line2D([], [], color=style.color, label=style.label) for style in styles.values()),
    ]


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
    return InteractiveFigure(
        f"rmse-{task}",
        f"RMSE by pressure, on a logarithmic scale. {_HOW}",
        "pressure (kPa)",
        "",
        traces,
        True,
    )


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
    return InteractiveFigure(
        "replay-errors",
        f"Simulated less measured, trial by trial. {_HOW}",
        "pressure (kPa)",
        "",
        traces,
    )


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
