"""The plots of a diagnosis, as PNG: before, after and the noise, wherever there are figures."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, NullLocator

from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import COLUMNS
from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.figure_text import figure, signal_name, signal_unit
from pma_gym.discovery.result.misfit import Gap, Map, ResidualLaw
from pma_gym.pages.figures import legend_below, picture, png

# Okabe and Ito's palette; markers and dashes tell apart what a weak printer does not.
BEFORE, PARAMETERS, AFTER = "#D55E00", "#0072B2", "#009E73"
MEASURED = {"color": "#666666", "linewidth": 2.6, "alpha": 0.6}
FLOOR = {"color": "#000000", "linestyle": (0, (4, 2)), "linewidth": 1.2}
_MOST_TRIALS = 30
_MOST_TICKS = 6
_LOGARITHMIC = 6.0
"""Misfit before over misfit after from which bars need a logarithmic scale."""


def gap_picture(gaps: dict[str, Gap], names: Sequence[str]) -> bytes:
    """Before, parameters refitted and after, one panel a signal, with the noise as a line.

    Args:
        gaps: by column name.
        names: what to call the three.
    """
    shares = [gap.before / max(gap.after, gap.floor, 1e-12) for gap in gaps.values()]
    with picture(2.6 * max(len(gaps), 2), 3.1) as drawn:
        panels = np.atleast_1d(np.array(drawn.subplots(1, len(gaps)), dtype=object))
        for panel, (signal, gap) in zip(panels, gaps.items(), strict=True):
            values = [gap.before, gap.parameters, gap.after]
            # A word a line: names of two words would touch their neighbours.
            lines = [name.replace(" ", "\n") for name in names]
            bars = panel.bar(lines, values, color=[BEFORE, PARAMETERS, AFTER], width=0.65)
            # Misfit in its unit, and below it in noises.
            labels = [f"{figure(v)}\n{figure(v / gap.floor, 2)} x noise" for v in values]
            panel.bar_label(bars, labels, padding=2, fontsize="small")
            panel.axhline(gap.floor, **FLOOR)
            panel.set_title(signal_name(signal))
            panel.set_ylabel(f"misfit, rms ({signal_unit(signal)})")
            if max(shares) > _LOGARITHMIC:
                _logarithmic(panel, [*values, gap.floor])
            else:
                panel.set_ylim(0.0, 1.3 * max(*values, gap.floor))
            panel.grid(visible=False, axis="x")
        line = Line2D([], [], label="noise of the measurement", **FLOOR)  # type: ignore[arg-type]
        legend_below(drawn, [line], 1)
        return png(drawn)


def trials_picture(diagnosis: Diagnosis) -> bytes:
    """Every trial's misfit over the noise, one panel a signal; the largest before on top."""
    records = sorted(
        diagnosis.trials, key=lambda each: max(map(_excess, each.gaps.values()), default=0.0)
    )[-_MOST_TRIALS:]
    signals = [name for name in diagnosis.gap if any(name in each.gaps for each in records)]
    size = 1.3 + 0.27 * len(records)
    with picture(2.6 + 2.1 * len(signals), size) as drawn:
        panels = np.atleast_1d(np.array(drawn.subplots(1, len(signals), sharey=True), dtype=object))
        for panel, signal in zip(panels, signals, strict=True):
            for row, record in enumerate(records):
                if signal in record.gaps:
                    _dots(panel, row, record.gaps[signal])
            panel.set_xscale("log")
            panel.axvline(1.0, **FLOOR)
            panel.set_title(signal_name(signal))
            panel.set_xlabel("misfit / noise")
            low, high = panel.get_xlim()
            panel.set_xlim(min(low, 0.5), max(high, 4.0))
            low, high = panel.get_xlim()
            panel.set_xticks(*_plain_ticks(low, high))
            panel.xaxis.set_minor_locator(NullLocator())
        panels[0].set_yticks(range(len(records)), [each.name for each in records])
        panels[0].set_ylim(-0.6, len(records) - 0.4)
        legend_below(drawn, _handles(diagnosis), 4)
        return png(drawn)


def _logarithmic(panel: Axes, values: Sequence[float]) -> None:
    """Bars whose lengths count factors, from half the smallest value on."""
    smallest = min((value for value in values if value > 0.0), default=1.0)
    low, high = 0.5 * smallest, 2.5 * max(*values, smallest)
    panel.set_yscale("log")
    panel.set_ylim(low, high)
    panel.set_yticks(*_plain_ticks(low, high))
    panel.yaxis.set_minor_locator(NullLocator())


def _plain_ticks(low: float, high: float) -> tuple[list[float], list[str]]:
    """1, 10, 100 for a logarithmic axis, and 2 and 5 between them where there is room."""
    decades = 10.0 ** np.arange(-6, 7)
    for each in (np.outer(decades, (1.0, 2.0, 5.0)).ravel(), decades):
        ticks = [float(tick) for tick in each if low <= tick <= high]
        if len(ticks) <= _MOST_TICKS:
            break
    return ticks, [f"{tick:g}" for tick in ticks]


def _excess(gap: Gap) -> float:
    return gap.before / gap.floor if gap.floor else 0.0


def _dots(panel: Axes, row: int, gap: Gap) -> None:
    floor = gap.floor or 1.0
    values = np.array([gap.before, gap.parameters, gap.after]) / floor
    panel.plot([values.min(), values.max()], [row, row], color="#c8ced6", linewidth=1.0, zorder=1)
    for value, color, marker in zip(
        values, (BEFORE, PARAMETERS, AFTER), ("o", "s", "D"), strict=True
    ):
        panel.plot([value], [row], marker, color=color, markersize=5, zorder=2)


def _handles(diagnosis: Diagnosis) -> list[Line2D]:
    """The legend of what was before and after."""
    held = any(each.held_out for each in diagnosis.trials)
    labels = ("model as given", "parameters refitted", after_name(diagnosis))
    labels = (*labels[:2], f"{labels[2]}, held out" if held else labels[2])
    marks = [
        Line2D([], [], color=color, marker=marker, linestyle="", label=label)
        for color, marker, label in zip(
            (BEFORE, PARAMETERS, AFTER), ("o", "s", "D"), labels, strict=True
        )
    ]
    return [*marks, Line2D([], [], label="noise", **FLOOR)]  # type: ignore[arg-type]


def after_name(diagnosis: Diagnosis) -> str:
    """What to call the model that the diagnosis ends with."""
    if diagnosis.verdict == "unknown" and diagnosis.approximate:
        return "best candidate"
    return "effect added" if diagnosis.effects else "model proposed"


def map_picture(maps: Sequence[Map]) -> bytes:
    """Mean residuals over two conditions each; empty where there are no data."""
    columns = min(len(maps), 2)
    rows = -(-len(maps) // columns)
    with picture(4.6 * columns, 3.4 * rows) as drawn:
        panels = np.array(drawn.subplots(rows, columns, squeeze=False)).ravel()
        for panel, each in zip(panels, maps, strict=False):
            largest = max(2.0, float(np.nanmax(np.abs(each.residual), initial=0.0)))
            panel.patch.set(facecolor="#e3e6ea", hatch="////", edgecolor="#ffffff")
            mesh = panel.pcolormesh(
                each.x_edges, each.y_edges, each.residual, cmap="PuOr", vmin=-largest, vmax=largest
            )
            panel.grid(visible=False)
            panel.set_title(f"{signal_name(each.signal)}: measured less simulated")
            panel.set_xlabel(each.x_name)
            panel.set_ylabel(each.y_name)
            drawn.colorbar(mesh, ax=panel, label="mean residual / noise")
        for panel in panels[len(maps) :]:
            panel.set_visible(False)
        return png(drawn)


def law_picture(law: ResidualLaw) -> bytes:
    """The flexible law of what is missing, with its 95 % band."""
    with picture(6.4, 3.4) as drawn:
        panel = drawn.subplots()
        panel.fill_between(law.at, law.low, law.high, color=PARAMETERS, alpha=0.25, linewidth=0)
        panel.plot(law.at, law.law, color=PARAMETERS)
        panel.axhline(0.0, color="#000000", linewidth=0.8)
        panel.set_xlabel(law.variable)
        panel.set_ylabel(f"missing {law.quantity}")
        return png(drawn)


def commands_picture(trial: Trial) -> bytes:
    """The commands of an experiment."""
    columns = [column for column in COLUMNS if column.quantity in trial.commands]
    with picture(8.2, 0.5 + 1.5 * len(columns)) as drawn:
        panels = np.atleast_1d(np.array(drawn.subplots(len(columns), 1, sharex=True), dtype=object))
        for panel, column in zip(panels, columns, strict=True):
            panel.plot(trial.time, column.from_si(trial.commands[column.quantity]), color="#000000")
            words = column.name.rpartition("_")[0].replace("_", " ")
            panel.set_ylabel(f"{words}\n({column.unit})")
            panel.yaxis.set_major_locator(MaxNLocator(4))
            panel.margins(y=0.15)
        panels[-1].set_xlabel("time (s)")
        return png(drawn)
