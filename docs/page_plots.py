"""Plots of two pages: the first controller beside a PID, and the leaderboards' table drawn."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter

from benchmarks.runner.rollout import make_environment, rollout
from controllers import PID
from pma_gym.pages.figures import legend_below, picture, png

DOCS = Path(__file__).parent
PRESSURE_KPA = 300.0
BLUE, ORANGE, BLACK = "#0072B2", "#D55E00", "#000000"


def first_controller_plot() -> bytes:
    """Extension, error and voltage of the page's controller and of the PID, at 300 kPa."""
    integral = runpy.run_path(str(DOCS / "examples" / "integral.py"))["Integral"]
    with picture(8.0, 3.4) as figure:
        axes: Any = figure.subplots(1, 3)
        for controller, label, color in ((integral(), "Integral", ORANGE), (PID(), "PID", BLUE)):
            environment = make_environment("displacement", "station", PRESSURE_KPA)
            trial = rollout(environment, controller, seed=1).trial
            ideal = 1e3 * environment.task.schedule.reference(trial.time)
            extension = 1e3 * trial.truth["extension"]
            curves = (extension, extension - ideal, trial.commands["motor_voltage"])
            for axis, values in zip(axes, curves, strict=True):
                axis.plot(trial.time, values, color=color, label=label)
        axes[0].plot(trial.time, ideal, color=BLACK, linestyle="--", label="Ideal")
        for axis, label in zip(
            axes, ("extension (mm)", "error (mm)", "motor voltage (V)"), strict=True
        ):
            axis.set_ylabel(label)
            axis.set_xlabel("time (s)")
        legend_below(figure, axes[0].get_lines(), 3)
        return png(figure)


def leaderboard_plot() -> bytes:
    """Interquartile means with their intervals, as the table of docs/leaderboards.md has them."""
    names, columns, cells = _leaderboard_table((DOCS / "leaderboards.md").read_text("utf-8"))
    places = np.arange(len(names))[::-1]
    with picture(10.0, 4.6) as figure:
        axes: Any = figure.subplots(1, len(columns), sharey=True)
        for axis, column, intervals in zip(axes, columns, cells, strict=True):
            for place, interval in zip(places, intervals, strict=True):
                if interval is not None:
                    mean, low, high = interval
                    color = BLACK if place == 0 else BLUE
                    axis.plot([low, high], [place, place], color=color, linewidth=2.4)
                    axis.plot([mean], [place], color=color, marker="o", markersize=4.5)
            axis.set_xscale("log")
            low, high = axis.get_xlim()
            subs = (1.0,) if high > 1000.0 * low else (1.0, 3.0)
            axis.xaxis.set_major_locator(LogLocator(subs=subs, numticks=9))
            axis.xaxis.set_major_formatter("{x:g}")
            axis.xaxis.set_minor_formatter(NullFormatter())
            axis.set_title(column)
            axis.set_xlabel("RMSE")
        axes[0].set_yticks(places, names)
        return png(figure)


Interval = tuple[float, float, float]


def _leaderboard_table(page: str) -> tuple[list[str], list[str], list[list[Interval | None]]]:
    """Names, columns, and by column a mean with its interval for each name, or None."""
    lines = [line for line in page.splitlines() if line.startswith("|")]
    header, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
    columns = [
        f"{suite}:\n{name.split(': ')[-1]}"
        for suite, name in zip(("robust", "robust", "hard", "hard"), header[1:], strict=True)
    ]
    names = [row[0].replace(", tenth trial", "").replace(", shipped", "") for row in rows]
    cells = [[_interval(row[at]) for row in rows] for at in range(1, len(header))]
    return names, columns, cells


def _interval(cell: str) -> Interval | None:
    """`1.25 [1.05, 1.45]` as numbers; None of a cell without."""
    if "[" not in cell:
        return None
    mean, low, high = (
        float(text) for text in cell.replace("[", "").replace("]", "").replace(",", "").split()
    )
    return mean, low, high
