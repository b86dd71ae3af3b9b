"""Bode and step plots of the linear loops, and their table of margins."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from benchmarks.report.margins import (
    Condition,
    Loop,
    frequencies_of,
    load_step,
    reference_step,
    response_of,
    worst,
)
from benchmarks.report.plot_style import Style
from benchmarks.report.tables import NONE, Labels, capital, figure
from pma_gym.envs import StationInfo
from pma_gym.pages.document import TextTable
from pma_gym.pages.figures import Plot, legend_below, picture
from pma_gym.units import SI_FACTORS

SHOWN_RAD_S = 0.3
"""Lowest frequency that is pictured (rad/s)."""

STEP_S = 1.0
"""How long a step is pictured (s)."""

LOAD_N = 50.0
"""Load step that is pictured (N): the size of an operator's pulse in suite `hard`."""

COLUMN_IN, AXIS_IN = 3.4, 0.8
"""Width of a pressure's panels, and of what stands beside them all (inches)."""


def loop_title(conditions: Sequence[Condition]) -> str:
    """Return the label of the loops' task: its name, and the load on the regulator.

    >>> from pma_gym.plant.model import load_model
    >>> from pma_gym.tasks import EVERY_TASK
    >>> nominal = load_model("station")
    >>> for name in ("rotation", "triangle_low"):
    ...     print(loop_title([Condition(StationInfo(nominal, EVERY_TASK[name], 3e5, 0.01), [])]))
    Rotation
    Triangle low, against 150 N
    """
    task = conditions[0].station.task
    title = capital(task.name.replace("_", " "))
    return f"{title}, against {task.load:g} N" if task.actuator == "regulator" else title


def margin_table(conditions: Sequence[Condition], labels: Labels) -> TextTable:
    """The least margins over the stroke of every controller at every pressure."""
    header = ["Controller", "Pressure (kPa)", "Gain margin | factor", "Gain margin | dB"]
    header += ["Phase margin (deg)", "Delay margin (ms)", "Largest sensitivity"]
    header += ["Crossover (Hz)", "Closed loop"]
    rows = []
    for name in dict.fromkeys(
        loop.name for condition in conditions for loop in condition.everywhere
    ):
        for condition in conditions:
            mine = [loop for loop in condition.everywhere if loop.name == name]
            if mine:
                rows.append([labels.get(name, name), *_margin_cells(condition, mine)])
    title = f"{loop_title(conditions)}: least margins at 5, 50 and 95 % of the stroke"
    return TextTable(title, header, rows)


def _margin_cells(condition: Condition, mine: Sequence[Loop]) -> list[str]:
    least = worst(mine)
    pressure = f"{condition.pressure_kpa:g}"
    if not least.stable:
        return [pressure, *[NONE] * 6, "**unstable**"]
    return [
        pressure,
        figure(least.gain),
        f"{20.0 * math.log10(least.gain):.1f}" if math.isfinite(least.gain) else "∞",
        f"{math.degrees(least.phase):.0f}" if math.isfinite(least.phase) else "∞",
        f"{1e3 * least.delay:.1f}" if math.isfinite(least.delay) else "∞",
        figure(least.sensitivity),
        figure(least.crossover / (2.0 * math.pi)),
        "stable",
    ]


def loop_plot(conditions: Sequence[Condition], styles: Mapping[str, Style]) -> Plot:
    """Bode plots and step responses: a column a pressure."""
    unit = conditions[0].station.task.schedule.unit
    with picture(COLUMN_IN * len(conditions) + AXIS_IN, 11.2) as canvas:
        axes: Any = canvas.subplots(4, len(conditions), sharex="row", sharey="row", squeeze=False)
        for column, condition in zip(axes.T, conditions, strict=True):
            for loop in condition.pictured:
                _draw(column, loop, condition.station, styles[loop.name])
            column[0].axhline(0.0, color="black", linewidth=0.8)
            column[1].axhline(-180.0, color="black", linewidth=0.8)
            column[2].axhline(1.0, color="black", linewidth=0.8)
            column[3].axhline(0.0, color="black", linewidth=0.8)
            column[0].set_title(f"{condition.pressure_kpa:g} kPa")
            for axis in column[:2]:
                axis.set_xscale("log")
                axis.xaxis.set_major_formatter("{x:g}")
                axis.set_xlabel("frequency (Hz)")
            for axis in column[2:]:
                axis.set_xlabel("time (s)")
        labels = ("loop gain (dB)", "loop phase (deg)", "step of reference (1)")
        for axis, label in zip(
            axes[:, 0], (*labels, f"step of {LOAD_N:g} N ({unit})"), strict=True
        ):
            axis.set_ylabel(label)
        axes[0, 0].set_ylim(-40.0, 60.0)
        axes[1, 0].set_ylim(-360.0, 0.0)
        axes[1, 0].set_yticks(range(-360, 1, 90))
        names = dict.fromkeys(loop.name for c in conditions for loop in c.pictured)
        handles = [
            Line2D([], [], color=styles[n].color, linestyle=styles[n].line, label=styles[n].label)
            for n in names
        ]
        legend_below(canvas, handles, min(len(handles), 2 * len(conditions)))
        return canvas


def _draw(axes: Any, loop: Loop, station: StationInfo, style: Style) -> None:  # noqa: ANN401
    """Gain, phase, reference step and load step of a loop."""
    line = {"color": style.color, "linestyle": style.line}
    frequencies = frequencies_of(station.period)
    frequencies = frequencies[frequencies >= SHOWN_RAD_S]
    response = response_of(loop.plant * loop.law, frequencies)
    hertz = frequencies / (2.0 * math.pi)
    axes[0].plot(hertz, 20.0 * np.log10(np.abs(response)), **line)
    axes[1].plot(hertz, _phase(response), **line)
    if not loop.margins.stable:
        # A step response that grows without end would hide the others.
        return
    axes[2].plot(*reference_step(loop, STEP_S), **line)
    times, position = load_step(loop, STEP_S)
    volts = LOAD_N / station.model.parameters["drive"].gain
    axes[3].plot(times, position * volts / SI_FACTORS[station.task.schedule.unit], **line)


def _phase(response: np.ndarray) -> np.ndarray:
    """Phase (deg), continuous, starting in -360 to 0."""
    phase = np.rad2deg(np.unwrap(np.angle(response)))
    return phase - 360.0 * np.ceil(phase[0] / 360.0)
