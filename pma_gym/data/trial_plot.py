"""Plots of trials: a panel a column of their files, several trials in the same panels."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pma_gym.data.trial_columns import COLUMNS, Column
from pma_gym.pages.figures import legend_below, picture

Array = NDArray[np.float64]

# Okabe and Ito's palette; widths tell lines apart where one hides the other.
_STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#0072B2", "linewidth": 2.2, "alpha": 0.75},
    {"color": "#D55E00", "linewidth": 1.2},
)
_WIDTH_IN, _PANEL_IN, _AXIS_IN = 7.2, 1.25, 0.7


class HasColumns(Protocol):
    """The part of a trial that `series_of` reads."""

    @property
    def time(self) -> Array:
        """Times (s), shape (n,)."""
        ...

    @property
    def commands(self) -> Mapping[str, Array]:
        """Commands by quantity, SI."""
        ...

    @property
    def measurements(self) -> Mapping[str, Array]:
        """Measurements by quantity, SI."""
        ...

    @property
    def truth(self) -> Mapping[str, Array]:
        """True values by quantity, SI."""
        ...


class Series(NamedTuple):
    """A trial's columns as files have them.

    Attributes:
        time: (s), shape (n,).
        columns: values by name in files, in its unit, shape (n,) each.
    """

    time: Array
    columns: Mapping[str, Array]


def series_of(trial: HasColumns) -> Series:
    """Commands, then measurements; the true value of what was not measured."""
    outputs = {**trial.truth, **trial.measurements}
    values = {
        column.name: column.from_si(group[column.quantity])
        for column, group in _placed(trial.commands, outputs)
    }
    return Series(trial.time, values)


def plot_series(trials: Mapping[str, Series], titles: Mapping[str, str] | None = None) -> Figure:
    """Draw trials over each other.

    Args:
        trials: at most two, by the name that the legend gives them; no legend for a single one.
        titles: text at the right above a column's panel, by the column's name.
    """
    names = [c.name for c in COLUMNS if any(c.name in each.columns for each in trials.values())]
    with picture(_WIDTH_IN, _AXIS_IN + _PANEL_IN * len(names)) as drawn:
        panels = np.atleast_1d(np.array(drawn.subplots(len(names), 1, sharex=True), dtype=object))
        for panel, name in zip(panels, names, strict=True):
            for style, (label, series) in zip(_STYLES, trials.items(), strict=False):
                if name in series.columns:
                    panel.plot(series.time, series.columns[name], label=label, **style)
            panel.set_ylabel(axis_label(name))
            panel.set_title((titles or {}).get(name, ""), loc="right", fontsize="small")
            panel.margins(x=0.0, y=0.1)
        drawn.align_ylabels(panels)
        panels[-1].set_xlabel("time (s)")
        if len(trials) > 1:
            _add_legend(drawn, panels, list(trials))
        return drawn


def axis_label(name: str) -> str:
    """A column's name as an axis says it, a word a line.

    >>> axis_label("motor_voltage_v").split()
    ['motor', 'voltage', '(V)']
    """
    (unit,) = (column.unit for column in COLUMNS if column.name == name)
    return "\n".join([*name.split("_")[:-1], f"({unit})"])


def _placed(
    commands: Mapping[str, Array], outputs: Mapping[str, Array]
) -> list[tuple[Column, Mapping[str, Array]]]:
    """Columns that there are values for, and where these are, in the order of files."""
    kinds = {"command": commands, "measurement": outputs}
    every = [(column, kinds.get(column.kind, {})) for column in COLUMNS]
    return [(column, group) for column, group in every if column.quantity in group]


def _add_legend(figure: Figure, panels: NDArray[Any], names: Sequence[str]) -> None:
    handles = {line.get_label(): line for panel in panels for line in panel.get_lines()}
    legend_below(figure, [handles[name] for name in names if name in handles], len(names))
