"""Values with their intervals, and the effects and parameters that a diagnosis gives them for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Estimate:
    """A parameter's value with its 95 % interval, in its file unit.

    Attributes:
        value: the value.
        low: lower end of the interval; None where the data do not bound it.
        high: upper end.
        unit: the unit.
        limit: `lower` or `upper` where the value is at that end of what the fit allows, else empty.
    """

    value: float
    low: float | None
    high: float | None
    unit: str
    limit: str = ""


@dataclass(frozen=True)
class Moved:
    """A parameter of the model that the data ask to change.

    Attributes:
        start: its value in the model that was given.
        now: its estimate, together with whatever effects were added.
        significant: whether it is said to be off: its estimate is more than three standard errors
            away, or, where nothing but parameters is off, by odds of 20 to 1. Where the verdict is
            `agrees`, refitting changes the signals by less than a tenth of their noise.
    """

    start: float
    now: Estimate
    significant: bool

    def document(self) -> dict[str, Any]:
        """The parameter in `diagnosis.json`."""
        return {
            "from": self.start,
            "to": self.now.value,
            "low": self.now.low,
            "high": self.now.high,
            "unit": self.now.unit,
            "significant": self.significant,
        }


@dataclass(frozen=True)
class Covariance:
    """How uncertain fitted parameters are together.

    Attributes:
        parameters: their paths, `effect.parameter_unit`.
        deviations: standard errors in file units.
        correlation: of them, shape (parameters, parameters).
    """

    parameters: tuple[str, ...] = ()
    deviations: tuple[float, ...] = ()
    correlation: tuple[tuple[float, ...], ...] = ()

    @classmethod
    def of(
        cls, paths: Sequence[str], deviations: Sequence[float], matrix: NDArray[np.float64]
    ) -> "Covariance":
        """Of parameters whose standard errors are finite, correlated as in a matrix.

        Args:
            paths: of the parameters.
            deviations: standard errors in file units.
            matrix: correlation, or covariance in any units, shape (paths, paths).
        """
        kept = np.flatnonzero(np.isfinite(deviations) & (np.diag(matrix) > 0.0)).tolist()
        inside = matrix[np.ix_(kept, kept)]
        spread = np.sqrt(np.diag(inside))
        correlation = np.clip(inside / np.outer(spread, spread), -1.0, 1.0)
        return cls(
            tuple(paths[i] for i in kept),
            tuple(float(deviations[i]) for i in kept),
            tuple(map(tuple, correlation.tolist())),
        )


@dataclass(frozen=True)
class RivalModel:
    """A model that explains the data as well as the written one, by other effects.

    Attributes:
        name: its effects.
        absent: values by effect and parameter, in file units, with which those of its effects that
            the written model lacks do nothing there.
        values: what differs from the written model with these, by path, in file units.
        covariance: of its fitted parameters.
    """

    name: str
    absent: Mapping[str, Mapping[str, Any]]
    values: Mapping[str, Any]
    covariance: Covariance

    def document(self) -> dict[str, Any]:
        """The model in `diagnosis.json`."""
        return {**vars(self), "covariance": vars(self.covariance)}


@dataclass(frozen=True)
class Undetermined:
    """A parameter of an effect that the data do not determine: it has left the effect's law.

    Attributes:
        above: value above which it lies (95 %), in its unit; None where nothing tells.
        below: the same from above.
        unit: the unit.
    """

    above: float | None
    below: float | None
    unit: str


@dataclass(frozen=True)
class NamedEffect:
    """An effect that the diagnosis adds to the model.

    Attributes:
        name: its name in the catalogue.
        confused_with: other candidates that explain these data as well.
        p_value: family-wise over the whole catalogue.
        parameters: estimates by column name.
        undetermined: parameters without an estimate, by column name (`nested_laws`).
    """

    name: str
    confused_with: tuple[str, ...]
    p_value: float
    parameters: Mapping[str, Estimate]
    undetermined: Mapping[str, Undetermined] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        """The effect in `diagnosis.json`."""
        return {
            "name": self.name,
            "confused_with": list(self.confused_with),
            "p_value": self.p_value,
            "parameters": {name: vars(each) for name, each in self.parameters.items()},
            "not_determined": {name: vars(each) for name, each in self.undetermined.items()},
        }


@dataclass(frozen=True)
class Approximate:
    """Effects that carry most of what is missing by laws that fit only approximately.

    Attributes:
        effects: they, with their sizes: what the verdict `effect` names, or the best candidates of
            the verdict `unknown`.
        left: share of the misfit beyond noise (mean square, summed over signals in units of their
            noise) that they leave.
        held_out: whether it is that of readings which the fits had not seen.
    """

    effects: tuple[NamedEffect, ...]
    left: float
    held_out: bool

    def document(self) -> dict[str, Any]:
        """The effects in `diagnosis.json`."""
        return {
            "effects": [effect.document() for effect in self.effects],
            "closed": 1.0 - self.left,
            "left": self.left,
            "held_out": self.held_out,
        }


@dataclass(frozen=True)
class TrialState:
    """What belongs to one trial and not to the model.

    Attributes:
        zeros: what each signal reads where the model says 0, by column, in its unit.
        parameters: of the model in this trial alone, by path, in their units.
    """

    zeros: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
