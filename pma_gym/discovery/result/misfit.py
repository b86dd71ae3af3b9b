"""Where and how far simulation and measurement lie apart, by signal, condition and trial."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """Where simulation and data disagree, before anything was refitted but parameters.

    Attributes:
        signal: column name of the measurement, `contraction_mm`.
        region: where, in words.
        share_of_gap: share of the signal's unexplained mean square that lies there.
        p_value: of so much there by chance, adjusted for all regions that were looked at.
    """

    signal: str
    region: str
    share_of_gap: float
    p_value: float


@dataclass(frozen=True)
class Gap:
    """How far simulation and measurement of one signal lie apart (root mean square, file units).

    Attributes:
        before: the model as it was given.
        parameters: its parameters refitted, nothing added.
        after: the amended model.
        floor: the noise of the measurement.
        held_out: whether `after` comes from fits without the trial, or stretch of a single one.
    """

    before: float
    parameters: float
    after: float
    floor: float
    held_out: bool

    @property
    def closed(self) -> float | None:
        """(before - after) / (before - floor), at most 1; None where there was no gap."""
        gap = self.before - self.floor
        if gap <= 0.02 * self.floor or self.before == 0.0:
            return None
        return min(1.0, (self.before - self.after) / gap)

    def document(self) -> dict[str, Any]:
        """The gap in `diagnosis.json`."""
        return {**vars(self), "closed": self.closed}


@dataclass(frozen=True)
class ResidualLaw:
    """What a flexible law finds missing where no effect of the catalogue fits.

    Attributes:
        quantity: what is missing, `force on the slide (N)`.
        variable: what it depends on, with unit, `contraction (mm)`.
        at: values of the variable, shape (n,).
        law: the law there, shape (n,).
        low: lower end of its 95 % band.
        high: upper end.
        words: its shape in words.
    """

    quantity: str
    variable: str
    at: Array
    law: Array
    low: Array
    high: Array
    words: str

    def document(self) -> dict[str, Any]:
        """The law in `diagnosis.json`."""
        return {
            "quantity": self.quantity,
            "variable": self.variable,
            "at": self.at.tolist(),
            "law": self.law.tolist(),
            "low": self.low.tolist(),
            "high": self.high.tolist(),
            "words": self.words,
        }


@dataclass(frozen=True)
class LatentForce:
    """What stands for all that a model of a free rig lacks, in one trial; shape (rows,) each.

    Attributes:
        quantity: what it is, `force on the slide (N)`.
        before: smoothed, parameters refitted and nothing added (SI).
        after: smoothed, of the proposed model; None where that adds nothing.
        over: what it may depend on, in the unit that its name has, `contraction (mm)`.
    """

    quantity: str
    before: Array
    after: Array | None
    over: Mapping[str, Array]


@dataclass(frozen=True)
class TrialRecord:
    """One trial's curves, for the report; SI, shape (rows, signals), NaN = gap.

    Attributes:
        name: the trial's file, or its number.
        time: (s), shape (rows,).
        measured: readings.
        before: simulated by the model as it was given.
        parameters: by the model with its parameters refitted.
        after: by the amended model; from a fit that had not seen the trial where `held_out`.
        gaps: by column name.
        held_out: see `after`.
        file: the log that it is a piece of, or its own name.
        columns: of the signals, in their order.
        latent: force that the model lacks; None where the method has none.
    """

    name: str
    time: Array
    measured: Array
    before: Array
    parameters: Array
    after: Array
    gaps: Mapping[str, Gap]
    held_out: bool
    file: str = ""
    columns: tuple[str, ...] = ()
    latent: LatentForce | None = None


@dataclass(frozen=True)
class Map:
    """A signal's residual over two conditions, for the report.

    Attributes:
        signal: column name.
        x_name: what runs along x, with unit.
        y_name: along y.
        x_edges: shape (n + 1,).
        y_edges: shape (m + 1,).
        residual: mean residual after the parameters were refitted, over the noise, shape (m, n);
            NaN where there are no data.
    """

    signal: str
    x_name: str
    y_name: str
    x_edges: Array
    y_edges: Array
    residual: Array


def rms(off: Array) -> float:
    """Root mean square, of what is there."""
    return float(np.sqrt(np.nanmean(off**2)))
