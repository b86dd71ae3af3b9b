"""A trial: what was commanded and what was measured, in a laboratory or in a simulation."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial_checks import (
    COMMANDS,
    check_commanded,
    check_memory_at_start,
    check_time,
    check_values,
)
from pma_gym.data.trial_columns import BY_QUANTITY, COLUMNS, Column, TrialError, suggestion

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

__all__ = ["COMMANDS", "MEASUREMENTS", "TRUTH", "Trial", "TrialError"]

MEASUREMENTS = tuple(column.quantity for column in COLUMNS if column.kind == "measurement")
"""contraction (m), rotation (rad), load (N), pressure (Pa)."""

TRUTH = (*MEASUREMENTS, *(s.reading for s in SIGNALS.values() if s.reading))
"""What a simulation knows without its sensors; extension in m."""

Arrays = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Trial:
    """One run of the station: laboratory, plant and rollout all return it.

    Arrays are copied, read-only, float64, of one length; NaN = not measured at that instant. A
    trial begins settled at its first commands.

    Attributes:
        time: strictly increasing (s), shape (n,).
        commands: at least one of `COMMANDS`, (n,) each: motor_voltage and regulator_voltage (V,
            0-10), load_command (what the drive is asked for, N), pressure_command (gauge, Pa).
        measurements: any of `MEASUREMENTS`, (n,) each: contraction (shortening from the resting
            length, m), rotation (0 at the start, grows as the motor winds in, rad), load (cable
            tension, N), pressure (gauge, Pa).
        truth: any of `TRUTH`, without noise and sensor lag; empty for a laboratory's trial.
        provenance: where it comes from, as text: model, seed, note...
        memory_at_start: where the muscle's hysteresis stands at the first sample, -1 to 1 (1: it
            was filled and has contracted); None: nobody says, so a simulation begins as its model
            does and a fit leaves it free.
    Raises:
        TrialError: a name, shape or value that breaks these rules.
    """

    time: NDArray[np.float64]
    commands: Arrays
    measurements: Arrays = field(default_factory=dict)
    truth: Arrays = field(default_factory=dict)
    provenance: Mapping[str, str] = field(default_factory=dict)
    memory_at_start: float | None = None

    def __post_init__(self) -> None:
        """Copy, freeze and check."""
        groups = {"commands": COMMANDS, "measurements": MEASUREMENTS, "truth": TRUTH}
        object.__setattr__(self, "time", _frozen("time", self.time))
        for group, names in groups.items():
            arrays = _frozen_group(group, getattr(self, group), names, self.time.shape)
            object.__setattr__(self, group, arrays)
        notes = {str(key): str(value) for key, value in self.provenance.items()}
        object.__setattr__(self, "provenance", MappingProxyType(notes))
        self._check()

    def __reduce__(self) -> tuple[type["Trial"], tuple[object, ...]]:
        """Pickle and copy by construction: a read-only mapping has no pickle of its own."""
        groups = (self.commands, self.measurements, self.truth, self.provenance)
        return Trial, (self.time, *(dict(group) for group in groups), self.memory_at_start)

    def __len__(self) -> int:
        """Number of samples."""
        return self.time.size

    @property
    def duration(self) -> float:
        """From the first sample to the last (s)."""
        return float(self.time[-1] - self.time[0])

    @property
    def zero_contraction(self) -> float:
        """Measured contraction x0 at the first sample (m), from which extension counts.

        Raises:
            TrialError: contraction was not measured, or not at the first sample.
        """
        contraction = self._measured("contraction")
        if np.isnan(contraction[0]):
            raise TrialError(
                "contraction_mm is empty at the first sample, so extension has no zero; "
                "begin the trial where contraction is measured"
            )
        return float(contraction[0])

    @property
    def extension(self) -> NDArray[np.float64]:
        """Measured extension y = x0 - x (m), shape (n,), positive when the muscle is pulled longer.

        Raises:
            TrialError: contraction was not measured, or not at the first sample.
        """
        return self.zero_contraction - self._measured("contraction")

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Measured angle of the pulley (rad), shape (n,), 0 where the trial starts.

        Raises:
            TrialError: rotation was not measured.
        """
        return self._measured("rotation")

    def measures(self, quantity: str) -> bool:
        """Whether it has a measurement of a physical quantity: "angle", "force", "pressure"..."""
        return any(SIGNALS[name].measures == quantity for name in self.measurements)

    def plot(self) -> "Figure":
        """Commands and measurements over time, a panel a column, in the units of files.

        A notebook shows the figure; a script calls its `show()`, or `savefig("trial.png")`.
        """
        # Imported here: most programs that use trials draw none, and Matplotlib takes a while.
        from pma_gym.data.trial_plot import plot_series, series_of

        return plot_series({"": series_of(self)})

    def to_frame(self) -> "DataFrame":
        """Return a pandas DataFrame: a row a sample, the columns of files with units in the names.

        The first column is `time_s`; true values stand behind `true_`, as `true_load_n`.

        Raises:
            ImportError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError(
                "to_frame needs pandas, which is not installed: pip install pandas"
            ) from None
        groups = (("", self.commands), ("", self.measurements), ("true_", self.truth))
        columns = {
            f"{before}{column.name}": column.from_si(values)
            for before, group in groups
            for name, values in group.items()
            for column in (Column.of(SIGNALS[name]),)
        }
        return pandas.DataFrame({"time_s": self.time, **columns})

    def _repr_html_(self) -> str:
        """What a notebook shows: the plot, and below it where the trial comes from."""
        from pma_gym.pages.document import Paragraph, Picture
        from pma_gym.pages.figures import notebook_html, png

        notes = "; ".join(f"{name}: {text}" for name, text in self.provenance.items())
        summary = f"Trial: {len(self)} samples, {self.duration:.6g} s. {notes}"
        blocks = [Paragraph(summary.strip()), Picture("trial", "")]
        return notebook_html(blocks, {"trial": png(self.plot())})

    def _check(self) -> None:
        def place(index: int) -> str:
            return f"sample {index}"

        check_time(self.time, place)
        check_memory_at_start(self.memory_at_start, "a trial")
        check_commanded(self.commands, "a trial")
        for group in (self.commands, self.measurements, self.truth):
            for quantity, values in group.items():
                column = BY_QUANTITY.get(quantity)
                name = column.name if column else quantity
                # Only voltages have limits, and a volt in a file is a volt inside.
                check_values(
                    name,
                    values,
                    column,
                    place,
                    "give what reached the drive: clip a controller's output, convert counts to V",
                )

    def _measured(self, quantity: str) -> NDArray[np.float64]:
        if quantity not in self.measurements:
            raise TrialError(
                f"the trial has no {BY_QUANTITY[quantity].name}; it has {_names(self.measurements)}"
            )
        return self.measurements[quantity]


def _frozen(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """A read-only copy as a one-dimensional array of floats."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TrialError(f"{name} must be an array of numbers: {error}") from None
    if array.ndim != 1 or array.size == 0:
        raise TrialError(f"{name} must have shape (n,) with n at least 1, got {array.shape}")
    array.setflags(write=False)
    return array


def _frozen_group(
    group: str, arrays: Mapping[str, ArrayLike], names: tuple[str, ...], shape: tuple[int, ...]
) -> Arrays:
    """A read-only mapping of frozen arrays with known names and the shape of time."""
    frozen = {}
    for name, values in arrays.items():
        if name not in names:
            raise TrialError(
                f"{group} are {', '.join(names)}, got {name!r}{suggestion(name, names)}"
            )
        frozen[name] = _frozen(name, values)
        if frozen[name].shape != shape:
            raise TrialError(
                f"{name} must be as long as time, {shape[0]} samples, got {frozen[name].size}"
            )
    return MappingProxyType(frozen)


def _names(quantities: Mapping[str, object]) -> str:
    """Names in files of what a mapping holds."""
    return ", ".join(BY_QUANTITY[quantity].name for quantity in quantities) or "no measurements"
