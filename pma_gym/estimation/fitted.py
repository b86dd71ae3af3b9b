"""The result of a fit, and its progress reports."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.plant.model import Model


@dataclass(frozen=True)
class Round:
    """Progress of a fit.

    Attributes:
        number: rounds so far.
        trials: how many trials they use now.
        chi_square: the least sum of squared residuals over these so far.
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
        covariance: of `parameters`, in their order, in SI, scaled as the errors, shape (p, p).
        values: the parameters in file units, by path, as `Model.replace` takes them.
        errors: their standard errors, by path: from the readings' noise, and where the model leaves
            more than noise unexplained, that much larger. Infinite for one that the trials do not
            determine; nan for one at a bound.
        chi_square: sum of squared residuals, in standard deviations of the readings.
        count: number of residuals.
        rounds: how many times the trials were simulated with all moves, few or all.
        simulated: trials simulated.
        converged: whether a further step would gain nothing worth while, or chi-square is too
            rugged for one: `CLOSE`, `SHARE` and `RUGGED` of `pma_gym.estimation.fitting`.
        at_bounds: paths of parameters that a bound holds.
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
        """Chi-square per degree of freedom: 1 where noise is all that is left."""
        return self.chi_square / max(self.count - len(self.values), 1)
