"""Measured trials as a fit reads them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data import calibration
from pma_gym.data.trial import Trial
from pma_gym.plant import sensors
from pma_gym.plant.compiled_model import OUTPUTS
from pma_gym.plant.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Logged:
    """A trial as a fit reads it.

    Attributes:
        time: times (s), shape (rows,).
        motor: motor voltage (V), shape (rows,).
        regulator: regulator voltage (V), shape (rows,).
        measured: readings (m, rad, N, Pa), 0 where missing, shape (4, rows).
        missing: rows without a reading that counts, by output.
        counts: 1 where a reading counts, else 0, shape (4, rows).
        measures: whether there is any that does, by output.
    """

    time: Array
    motor: Array
    regulator: Array
    measured: Array
    missing: list[NDArray[np.int64]]
    counts: Array
    measures: list[bool]

    @classmethod
    def of(cls, model: Model, number: int, trial: Trial) -> "Logged":
        """From a trial.

        Args:
            model: says what commanded loads and pressures are in volts.
            number: which trial it is, for the message.
            trial: the trial.
        Raises:
            ValueError: it measures nothing.
        """
        motor, regulator = sensors.voltages(model, trial)
        nothing = np.full(len(trial.time), np.nan)
        measured = np.stack([trial.measurements.get(name, nothing) for name in OUTPUTS])
        absent = np.isnan(measured) | _at_an_end(measured)
        absent |= np.isin(OUTPUTS, model.rig.absent_outputs)[:, None]
        if absent.all():
            raise ValueError(f"trial {number} has no measurements to fit a model to")
        return cls(
            trial.time,
            motor,
            regulator,
            np.where(absent, 0.0, measured),
            [np.flatnonzero(row) for row in absent],
            np.where(absent, 0.0, 1.0),
            [not row.all() for row in absent],
        )

    @property
    def first(self) -> tuple[float, float]:
        """The first commands (V)."""
        return float(self.motor[0]), float(self.regulator[0])

    @property
    def count(self) -> int:
        """How many readings there are."""
        return self.measured.size - sum(rows.size for rows in self.missing)


def _at_an_end(measured: Array) -> NDArray[np.bool_]:
    """Whether readings (SI), shape (4, rows), are the first or last that the DAQ has."""
    lines = [line for _, line in sensors.SENSORS.values()]
    volts = np.stack([line.to_volts(row) for line, row in zip(lines, measured, strict=True)])
    return np.abs(volts) >= calibration.DAQ_LIMIT - 1.5 * calibration.DAQ_STEP
