"""The report's plots of trials: reference and response, error, voltage, actual against ideal."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from benchmarks.report.plot_style import BOUND, MEASURED, REFERENCE, Style, controller_styles
from benchmarks.reproduction.replay import QUANTITIES, all_replay_errors, summarise
from benchmarks.reproduction.results import Results
from benchmarks.runner.phase_score import PHASES, UNITS, measured_score
from pma_gym.data.trial import Trial
from pma_gym.data.trial_schedule import SCHEDULES, TrialSchedule
from pma_gym.metrics import phase_times
from pma_gym.pages.figures import Plot, legend_below, picture
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
        handles = [Line2D([], [], label="Measured", **MEASURED)]
        handles += [
            Line2D([], [], color=style.color, marker=style.marker, label=style.label)
            for style in styles.values()
        ]
        if "III" in phases and results.bounds:
            handles.append(Line2D([], [], label="Achievable bound", **BOUND))
        legend_below(figure, handles, min(len(handles), 6))
        return figure


def replay_plot(results: Results) -> Plot:
    """Signed errors of the replay: a row a quantity, a column a phase, a bar a trial."""
    errors = all_replay_errors(results, results.suite.models[0])
    color = controller_styles(results.suite)[results.suite.goals.replay].color
    with picture(11.0, 12.4) as figure:
        axes: Any = figure.subplots(len(QUANTITIES), len(errors), sharex="col", squeeze=False)
        for column, ((task, phase), trials) in enumerate(errors.items()):
            places = np.arange(len(trials))
            means = summarise(trials).signed
            name = "displacement" if task == "displacement" else f"rotation, phase {phase}"
            axes[0, column].set_title(name)
            for row, quantity in enumerate(QUANTITIES):
                axis = axes[row, column]
                axis.bar(places, [getattr(t, quantity) for t in trials], 0.7, color=color)
                axis.axhline(0.0, color="black", linewidth=0.9)
                axis.axhline(means[quantity], color=_GREY, linewidth=1.2, linestyle=(0, (4, 2)))
                axis.set_ylabel(QUANTITY_LABELS[quantity].format(unit=UNITS[task]))
                axis.grid(visible=False, axis="x")
            labels = [f"{trial.pressure_kpa:g}" for trial in trials]
            axes[-1, column].set_xticks(places, labels, rotation=90)
            axes[-1, column].set_xlabel("pressure (kPa)")
        figure.align_ylabels()
        mean = Line2D([], [], color=_GREY, linestyle=(0, (4, 2)), label="mean over the trials")
        bars = Patch(color=color, label="simulated less measured")
        legend_below(figure, [bars, mean], 2)
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
        axes[2, 0].set_ylabel(f"actual − ideal ({unit}),\nenlarged")
        axes[2, 0].set_ylim(-_ENLARGED[task], _ENLARGED[task])
        axes[3, 0].set_ylabel("motor voltage (V)")
        axes[3, 0].set_ylim(0.0, None)
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
