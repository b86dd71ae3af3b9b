"""Measured trials in the form that a fit needs.

Parameters of a model that a fit may change.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.quality.clipping import at_daq_end
from pma_gym.data.signals import VOLTAGE_RANGE, Signal
from pma_gym.data.trial import Trial
from pma_gym.plant import sensors
from pma_gym.plant.model import Model
from pma_gym.plant.program import parameter_names
from pma_gym.units import Quantity

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Logged:
    """A measured trial in the form that a fit needs.

    Attributes:
        signals: the measured signals of the rig, in the order of `measured`.
        time: times (s), shape (rows,).
        motor: motor voltage (V), or the command that the drive takes as it comes (SI), shape
            (rows,).
        regulator: regulator voltage (V), shape (rows,).
        measured: readings (SI), 0 where missing, shape (signals, rows).
        missing: rows without a reading that counts, by output.
        counts: 1 where a reading counts, else 0, shape (signals, rows).
        measures: whether there is any that does, by output.
        motor_span: range of the motor's command: of its voltage, else what the trial goes through.
    """

    signals: tuple[Signal, ...]
    time: Array
    motor: Array
    regulator: Array
    measured: Array
    missing: list[NDArray[np.int64]]
    counts: Array
    measures: list[bool]
    motor_span: float

    @classmethod
    def of(cls, model: Model, number: int, trial: Trial) -> "Logged":
        """Convert a trial.

        Args:
            model: model that converts commanded loads and pressures to voltages.
            number: number of the trial, for the message.
            trial: the trial.
        Raises:
            ValueError: a trial without measurements.
        """
        motor, regulator = sensors.voltages(model, trial)
        nothing = np.full(len(trial.time), np.nan)
        signals = model.rig.signals
        measured = np.stack([trial.measurements.get(each.name, nothing) for each in signals])
        ends = [at_daq_end(each, row) for each, row in zip(signals, measured, strict=True)]
        absent = np.isnan(measured) | np.stack(ends)
        if absent.all():
            raise ValueError(f"trial {number} has no measurements to fit a model to")
        return cls(
            signals,
            trial.time,
            motor,
            regulator,
            np.where(absent, 0.0, measured),
            [np.flatnonzero(row) for row in absent],
            np.where(absent, 0.0, 1.0),
            [not row.all() for row in absent],
            float(np.ptp(motor if sensors.direct_command(model) else VOLTAGE_RANGE)),
        )

    def row(self, rows: Array, *measures: str) -> Array:
        """The row of the first signal that measures one of some quantities; zeros without one.

        Args:
            rows: of the rig's signals, shape (signals, rows).
            measures: quantities, as `Signal.measures` has them.
        """
        at = self.channel(*measures)
        return np.zeros(rows.shape[-1]) if at is None else rows[at]

    def channel(self, *measures: str) -> int | None:
        """Which row is of the first signal that measures one of some quantities; None: no such."""
        for channel, signal in enumerate(self.signals):
            if signal.measures in measures:
                return channel
        return None

    @cached_property
    def channels(self) -> list[int]:
        """Which signals have a reading that counts."""
        return [channel for channel, known in enumerate(self.measures) if known]

    @property
    def first(self) -> tuple[float, float]:
        """Commands in the first row (V)."""
        return float(self.motor[0]), float(self.regulator[0])

    @property
    def count(self) -> int:
        """Number of measurements."""
        return self.measured.size - sum(rows.size for rows in self.missing)


@dataclass(frozen=True)
class FreeParameter:
    """A free parameter of a fit.

    Attributes:
        path: `effect.parameter_unit`, as in `Model.paths`.
        place: its index in the vector of the compiled functions.
        quantity: its unit and bounds.
    """

    path: str
    place: int
    quantity: Quantity


def free_parameters(model: Model, paths: Sequence[str]) -> list[FreeParameter]:
    """Look up the free parameters of a model by their paths."""
    names, parameters = parameter_names(model), []
    for path in paths:
        effect, _, file_key = path.partition(".")
        law = model.effects[effect]
        stem = law.names_in_files()[file_key]
        place = 1 + names.index(f"{effect}.{stem}")
        parameters.append(FreeParameter(path, place, law.quantities[stem]))
    return parameters
