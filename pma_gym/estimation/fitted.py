"""The result of a fit, and its progress reports."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.plant.model import Model


@dataclass(frozen=True)
class Round:
    """Progress of a fit.

    Attributes:
        number: number of rounds so far.
        trials: number of trials in use.
        chi_square: smallest sum of squared residuals over these trials so far.
        values: its parameters by path, in file units.
    """

    number: int
    trials: int
    chi_square: float
    values: dict[str, float]


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        model: the model with the fitted parameters.
        parameters: the fitted parameters in SI, by `effect.parameter`.
        covariance: covariance of `parameters`, in their order, in SI, scaled as the errors, shape
            (p, p).
        values: the parameters in file units, by path, for `Model.replace`.
        errors: their standard errors, by path, from the measurement noise; scaled up if the
            residuals exceed the noise. Infinite for a parameter that the trials do not determine;
            nan for one at a bound.
        chi_square: sum of squared residuals, in standard deviations of the measurements.
        count: number of residuals.
        rounds: number of rounds, each with all finite differences.
        simulated: number of simulated trials.
        converged: whether the fit has converged, by `CLOSE`, `SHARE` or `RUGGED` of
            `pma_gym.estimation.fitting`.
        at_bounds: paths of parameters at a bound.
    """

    model: Model
    parameters: dict[str, float]
    covariance: NDArray[np.float64]
    values: dict[str, float]
    errors: dict[str, float]
    chi_square: float
    count: int
    rounds: int
    simulated: int
    converged: bool
    at_bounds: tuple[str, ...]

    @property
    def reduced_chi_square(self) -> float:
        """Chi-square per degree of freedom: 1 if the residuals are noise only."""
        return self.chi_square / max(self.count - len(self.values), 1)
