"""Two trials of the same commands beside each other: measured and simulated, before and after."""

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

Array = NDArray[np.float64]


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
        from pma_gym.data.trial_plot import plot_series, series_of

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
