"""Two trials of the same commands beside each other: measured and simulated, before and after.

Plots of trials: a panel a column of their files, several trials in the same panels.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial, TrialError
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.metrics import rmse
from pma_gym.units import SI_FACTORS

if TYPE_CHECKING:
    from matplotlib.figure import Figure
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from matplotlib.figure import Figure

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


@dataclass(frozen=True)
class TrialComparison:
    """How far two trials lie apart.

    Attributes:
        trials: the two, by name.
        rmse: root mean square of their difference by column (`contraction_mm`), in its unit, over
            the times that both have.
        samples: how many instants it was taken over, by column.
    """

    trials: Mapping[str, Trial]
    rmse: Mapping[str, float]
    samples: Mapping[str, int]

    def plot(self) -> "Figure":
        """Both trials over time, a panel a column, with the RMSE above it.

        A notebook shows the figure; a script calls its `show()`, or `savefig("both.png")`.
        """
        titles = {name: f"RMSE {_value(name, size)}" for name, size in self.rmse.items()}
        return plot_series({name: series_of(each) for name, each in self.trials.items()}, titles)

    def __str__(self) -> str:
        """A line a column."""
        return "\n".join(f"{name}: RMSE {_value(name, size)}" for name, size in self.rmse.items())

    def _repr_html_(self) -> str:
        """What a notebook shows: the figures, and the plot below them."""
        from pma_gym.pages.document import Picture, TextTable
        from pma_gym.pages.figures import notebook_html, png

        rows = [[name, _value(name, size)] for name, size in self.rmse.items()]
        table = TextTable(" and ".join(self.trials), ["Column", "RMSE"], rows)
        return notebook_html([table, Picture("both", "")], {"both": png(self.plot())})


def compare(
    first: Trial, second: Trial, names: tuple[str, str] = ("first", "second")
) -> TrialComparison:
    """How far two trials lie apart, in every quantity that both have.

    Where the second has other times, its values are interpolated linearly to the first's. What is
    not measured is compared by its true value, which a simulation has.

    Args:
        first: a trial; its times are the ones compared at.
        second: another, of the same commands.
        names: what legends and tables call them.
    Raises:
        TrialError: equal names, or no quantity and time that both have.

    Example:
        >>> from pma_gym import Plant
        >>> commands = {"motor_voltage": [0.0, 3.0], "regulator_voltage": [5.0, 5.0]}
        >>> asked = Trial(time=[0.0, 2.0], commands=commands)
        >>> quiet, noisy = (Plant("serres2008").simulate(asked, noise) for noise in (False, True))
        >>> list(compare(quiet, noisy).rmse)
        ['contraction_mm', 'rotation_deg', 'load_n', 'pressure_kpa']
    """
    if names[0] == names[1]:
        raise TrialError(f"names must differ, both are {names[0]!r}; name them by their origin")
    outputs = [{**each.truth, **each.measurements} for each in (first, second)]
    sizes, samples = {}, {}
    for quantity, column in BY_QUANTITY.items():
        if all(quantity in each for each in outputs):
            there = _interpolated(first.time, second.time, outputs[1][quantity])
            difference = outputs[0][quantity] - there
            difference = difference[~np.isnan(difference)]
            if difference.size:
                sizes[column.name] = rmse(difference) / SI_FACTORS[column.unit]
                samples[column.name] = int(difference.size)
    if not sizes:
        raise TrialError(
            f"{names[0]} has {', '.join(outputs[0]) or 'no measurements'} from "
            f"{first.time[0]:g} to {first.time[-1]:g} s, {names[1]} has "
            f"{', '.join(outputs[1]) or 'no measurements'} from {second.time[0]:g} to "
            f"{second.time[-1]:g} s: nothing to compare; simulate the one without measurements"
        )
    return TrialComparison(dict(zip(names, (first, second), strict=True)), sizes, samples)


def _interpolated(instants: Array, time: Array, values: Array) -> Array:
    """Values at wanted times, from those that are measured; NaN beyond them."""
    known = ~np.isnan(values)
    if not known.any():
        return np.full(instants.shape, np.nan)
    return np.interp(instants, time[known], values[known], left=np.nan, right=np.nan)


def _value(name: str, size: float) -> str:
    """A figure with its unit."""
    (unit,) = (column.unit for column in BY_QUANTITY.values() if column.name == name)
    return f"{size:.3g} {unit}"
