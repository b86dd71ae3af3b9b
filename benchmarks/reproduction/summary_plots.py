"""The report's plots of figures: RMSE by pressure, and the replay's signed errors."""

from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from benchmarks.report.plot_style import BOUND, MEASURED, controller_styles
from benchmarks.reproduction.replay import QUANTITIES, all_replay_errors, summarise
from benchmarks.reproduction.results import Results
from benchmarks.runner.phase_score import PHASES, UNITS, measured_score
from pma_gym.pages.figures import Plot, legend_below, picture

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
