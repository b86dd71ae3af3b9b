"""The leaderboard's plots: distributions, profiles, error by pressure; loops' margins.

Plot styles: one colour and one marker for each controller, in every picture.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from benchmarks.report.margins import (
    Condition,
    Loop,
    frequencies_of,
    load_step,
    reference_step,
    response_of,
    worst,
)
from benchmarks.report.standings import Standings
from benchmarks.report.statistics import profile
from benchmarks.report.tables import NONE, Labels, capital, figure
from benchmarks.suites.reproduction import ReproductionSuite
from pma_gym.envs import StationInfo
from pma_gym.pages.document import TextTable
from pma_gym.pages.figures import Plot, legend_below, picture
from pma_gym.units import SI_FACTORS

Dashes = Literal["-", "--", "-.", ":"]

# Okabe and Ito's palette, told apart by the colour-blind and in grey by the order of lightness;
# then three of Tol's darker ones. Marker and line tell apart what a weak printer does not.
_FIXED: dict[str, tuple[str, str, Dashes]] = {
    "serres_replay": ("#D55E00", "s", "-"),
    "serres_feedforward": ("#CC79A7", "D", "-"),
    "improved_feedforward": ("#E69F00", "^", "-"),
    "pid": ("#0072B2", "v", "-"),
    "feedforward_pid": ("#009E73", "o", "-"),
    "lqg": ("#882255", "<", "--"),
    "adrc": ("#999933", "X", "--"),
    "sliding_mode": ("#CC79A7", "h", "--"),
    "mpc": ("#332288", "p", "--"),
    "ilc": ("#D55E00", "d", "--"),
    "oracle": ("#000000", "*", ":"),
    "ppo": ("#56B4E9", "P", "-"),
    "ppo_ilc": ("#56B4E9", "d", "--"),
    # Those of exercises never meet those of other tasks above, but for the policy.
    "constant_pressure": ("#CC79A7", "D", "-."),
    "scheduled_pressure": ("#E69F00", "^", "-."),
    "speed_pid": ("#0072B2", "v", "-."),
    "moment_pid": ("#009E73", "o", "-."),
    "exercise_mpc": ("#332288", "p", "--"),
}
_OTHERS: tuple[tuple[str, str, Dashes], ...] = (
    ("#CC79A7", "D", "-."),
    ("#56B4E9", "P", "-."),
    ("#8C564B", "X", "-."),
    ("#7F7F7F", "*", "-."),
)

REFERENCE = {"color": "#000000", "linestyle": (0, (5, 3)), "linewidth": 1.1}
MEASURED = {"color": "#666666", "linewidth": 2.6, "alpha": 0.75}
BOUND = {"color": "#000000", "linestyle": (0, (1, 1.5)), "linewidth": 1.4}


@dataclass(frozen=True)
class Style:
    """Plot style of a controller.

    Attributes:
        label: in legends.
        color: of its lines, bars and markers.
        marker: of its points.
        line: dashes of its lines, where many are drawn in one panel.
    """

    label: str
    color: str
    marker: str
    line: Dashes = "-"


def controller_styles(suite: ReproductionSuite) -> dict[str, Style]:
    """A style for each controller of a suite, by name."""
    return styles_of({controller.name: controller.label for controller in suite.controllers})


def styles_of(labels: Mapping[str, str]) -> dict[str, Style]:
    """A style for each controller of a report.

    Args:
        labels: what people call the controllers, by name.
    Returns:
        Its own for one that the package has, one of the free ones for another, by name.
    """
    taken = {_FIXED[name][0] for name in labels if name in _FIXED}
    free = [other for other in _OTHERS if other[0] not in taken]
    others = [name for name in labels if name not in _FIXED]
    own = {name: free[at % len(free)] for at, name in enumerate(others)} | _FIXED
    return {name: Style(label, *own[name]) for name, label in labels.items()}


Styles = Mapping[str, Style]

_GREY = "#666666"
_BOX = {"linewidth": 1.1}
_LONG = 15.0
"""Ratio of an axis' ends above which only 1, 2 and 5 are written."""

THRESHOLDS = 120
"""Points of a performance profile."""


def distribution_plot(every: Sequence[Standings], styles: Styles) -> Plot:
    """Plot each controller's cases, and its interquartile mean with its interval."""
    most = max(len(standings.rows) for standings in every)
    with picture(11.0, 0.9 + len(every) * (0.75 + 0.27 * most)) as canvas:
        axes: Any = canvas.subplots(len(every), 1, squeeze=False)
        for axis, standings in zip(axes[:, 0], every, strict=True):
            _boxes(axis, standings, styles)
        handles = [
            Line2D([], [], color=_GREY, linewidth=1.1, label="5–95 % of the cases"),
            Patch(facecolor="#d9dde2", edgecolor=_GREY, label="middle half, median"),
            Line2D(
                [],
                [],
                color="black",
                linewidth=2.6,
                marker="|",
                markersize=9,
                label="95 % interval",
            ),
            Line2D([], [], color="black", linestyle="", marker="o", label="interquartile mean"),
        ]
        legend_below(canvas, handles, 4)
        return canvas


def _boxes(axis: Any, standings: Standings, styles: Styles) -> None:  # noqa: ANN401
    """A row a controller, the best on top."""
    measure = standings.errors.measure
    for place, row in enumerate(reversed(standings.rows)):
        style = styles[row.name]
        low, first, middle, third, high = np.quantile(
            standings.errors.of(row.name), (0.05, 0.25, 0.5, 0.75, 0.95)
        )
        axis.plot([low, high], [place, place], color=style.color, **_BOX)
        axis.barh(
            place,
            third - first,
            0.56,
            first,
            facecolor=style.color,
            edgecolor=style.color,
            alpha=0.28,
        )
        axis.plot([middle, middle], [place - 0.28, place + 0.28], color=style.color, **_BOX)
        if not np.isnan(row.mean.low):
            axis.plot(row.mean[1:], [place, place], color="black", linewidth=2.6, marker="|")
        axis.plot(
            row.mean.estimate,
            place,
            linestyle="",
            marker=style.marker,
            markersize=7,
            color=style.color,
            markeredgecolor="black",
            markeredgewidth=0.7,
        )
    names = [styles[row.name].label for row in reversed(standings.rows)]
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(-0.6, len(names) - 0.4)
    axis.grid(visible=False, axis="y")
    _logarithmic(axis.xaxis, axis)
    axis.set_xlabel(f"RMSE ({measure.unit})")
    axis.set_title(capital(measure.name), loc="left")


def profile_plot(every: Sequence[Standings], styles: Styles) -> Plot:
    """Share of the cases with an error up to a threshold, with 95 % bands."""
    with picture(11.0, 0.9 + 3.6 * len(every)) as canvas:
        axes: Any = canvas.subplots(len(every), 1, squeeze=False)
        for axis, standings in zip(axes[:, 0], every, strict=True):
            errors = standings.errors
            positive = errors.values[errors.values > 0.0]
            thresholds = np.geomspace(positive.min() * 0.9, positive.max() * 1.1, THRESHOLDS)
            for at, name in enumerate(errors.names):
                share, low, high = profile(errors.values[at], thresholds, standings.draws)
                style = styles[name]
                axis.fill_between(
                    thresholds, 100 * low, 100 * high, color=style.color, alpha=0.12, linewidth=0
                )
                axis.plot(
                    thresholds,
                    100 * share,
                    color=style.color,
                    linestyle=style.line,
                    marker=style.marker,
                    markevery=[_marked(share, at / len(errors.names))],
                    markersize=6.5,
                )
            _logarithmic(axis.xaxis, axis)
            axis.set(
                ylim=(-2.0, 102.0),
                ylabel="cases (%)",
                xlabel=f"RMSE at most ({errors.measure.unit})",
            )
            axis.set_title(capital(errors.measure.name), loc="left")
        legend_below(canvas, _handles(every, styles), 4)
        return canvas


def _marked(share: np.ndarray, place: float) -> int:
    """Which point of a rising profile carries the marker: another height for every controller."""
    return int(np.argmax(share >= 0.15 + 0.7 * place))


def pressure_plot(every: Sequence[Standings], styles: Styles) -> Plot:
    """Median error of every controller at every pressure, with the middle half of the best."""
    with picture(11.0, 0.9 + 3.2 * len(every)) as canvas:
        axes: Any = canvas.subplots(len(every), 1, squeeze=False)
        for axis, standings in zip(axes[:, 0], every, strict=True):
            errors = standings.errors
            at_pressure = np.array([episode.pressure_kpa for episode in errors.episodes])
            pressures = np.unique(at_pressure)
            for name in errors.names:
                style, values = styles[name], errors.of(name)
                medians = [np.median(values[at_pressure == p]) for p in pressures]
                axis.plot(
                    pressures,
                    medians,
                    color=style.color,
                    linestyle=style.line,
                    marker=style.marker,
                    markersize=5.5,
                )
            _logarithmic(axis.yaxis, axis)
            axis.set_xticks(pressures, [f"{p:g}" for p in pressures])
            axis.set(xlabel="pressure (kPa)", ylabel=f"median RMSE ({errors.measure.unit})")
            axis.set_title(capital(errors.measure.name), loc="left")
        legend_below(canvas, _handles(every, styles), 4)
        return canvas


def _logarithmic(line: Any, axis: Any) -> None:  # noqa: ANN401
    """A logarithmic axis with plain numbers, more of them the shorter it is."""
    low, high = line.get_data_interval()
    between = [2, 5] if high > _LONG * low else [1.5, 2, 3, 4, 5, 7]
    set_scale = axis.set_xscale if line is axis.xaxis else axis.set_yscale
    set_scale("log", subs=between)
    line.set_major_formatter("{x:g}")
    line.set_minor_formatter("{x:g}")
    line.grid(visible=True, which="minor", color="#eef0f3")


def _handles(every: Sequence[Standings], styles: Styles) -> list[Line2D]:
    """Entries of a legend, in the order of the styles."""
    shown = {name for standings in every for name in standings.errors.names}
    return [
        Line2D([], [], color=s.color, marker=s.marker, linestyle=s.line, label=s.label)
        for name, s in styles.items()
        if name in shown
    ]


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
    words = capital(task.name.replace("_", " "))
    return f"{words}, against {task.load:g} N" if task.actuator == "regulator" else words


def margin_table(conditions: Sequence[Condition], labels: Labels) -> TextTable:
    """The least margins over the stroke of every controller at every pressure."""
    header = [
        "Controller",
        "Pressure (kPa)",
        "Gain margin | factor",
        "Gain margin | dB",
        "Phase margin (deg)",
        "Delay margin (ms)",
        "Largest sensitivity",
        "Crossover (Hz)",
        "Closed loop",
    ]
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
        axes[1, 0].set(ylim=(-360.0, 0.0), yticks=range(-360, 1, 90))
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
