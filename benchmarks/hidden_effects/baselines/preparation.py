"""Input of baselines: a data set beside its model, whose own parameters are refitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import Dataset
from pma_gym.discovery.answer.own_parameters import MOVED
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import free_parameters, unit, values
from pma_gym.discovery.preparation.initial_floors import Level, initial_floors
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.residuals import simulated_less_measured
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import load_model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prepared:
    """A data set beside its model.

    Attributes:
        problem: the trials, their noise taken for white.
        refitted: the model with its own parameters refitted.
        whitened: the trials beside it.
        readings: what its sensors hold (SI), shape (4, rows) for each trial.
        left: those less what was measured, free zeros taken out, in standard deviations of the
            noise; NaN where nothing was measured.
        floors: noise of the four outputs.
        orders: which repeat each trial is, or None.
    """

    problem: FitProblem
    refitted: Fitted
    whitened: WhitenedResiduals
    readings: Sequence[Array]
    left: Sequence[Array]
    floors: Sequence[Level]
    orders: Sequence[float] | None

    @property
    def catalogue(self) -> list[CandidateEffect]:
        """Every effect that the model lacks."""
        return candidate_effects(self.problem.given, self.orders)

    @property
    def moved(self) -> bool:
        """Whether a parameter left the value that was given by more than its error."""
        return any(each["significant"] for each in moved(self.problem, self.refitted).values())


def prepare(dataset: Dataset, threads: int) -> Prepared:
    """Refit a model's own parameters to a data set, noise white and of the level seen at rest.

    Args:
        dataset: it names its model.
        threads: that simulate.
    Raises:
        ValueError: the model cannot be simulated on these trials.
    """
    given = load_model(dataset.model or "station")
    trials = [named.trial for named in dataset.trials]
    logged = [Logged.of(given, i, trial) for i, trial in enumerate(trials)]
    floors = initial_floors(given, logged, dataset.trials)
    noise = tuple(white_noise(floor.level) for floor in floors)
    problem = FitProblem(trials, given, free_parameters(given), noise, threads)
    refitted = problem.careful_fit(given)
    if refitted is None:
        raise ValueError(
            f"model {given.name} cannot be simulated on the trials of {dataset.title}: its muscle "
            "does not balance the load where one begins; check the units of the commands"
        )
    whitened = problem.whitened_residuals(refitted.model)
    readings = whitened.readings(refitted.values)
    assert readings is not None
    levels = np.array([floor.level for floor in floors])[:, None]
    left = [part / levels for part in simulated_less_measured(whitened, readings)]
    orders = [named.order for named in dataset.trials]
    known = None if None in orders else [float(order or 0.0) for order in orders]
    return Prepared(problem, refitted, whitened, readings, left, floors, known)


def noise_of(left: Sequence[Array], problem: FitProblem) -> FitProblem:
    """The same bench with white noise of the variance that a residual has (rms, by output)."""
    squares = [np.nanmean(np.concatenate([part[c] ** 2 for part in left])) for c in range(4)]
    noise = tuple(
        white_noise(before.level * float(np.sqrt(square))) if np.isfinite(square) else before
        for before, square in zip(problem.noise, squares, strict=True)
    )
    return replace(problem, noise=noise)


def moved(problem: FitProblem, fit: Fitted) -> dict[str, dict[str, Any]]:
    """The model's own parameters and by how much they moved, as `diagnosis.json` has them."""
    changes = {}
    for path, start in zip(problem.own.free, values(problem.given, problem.own.free), strict=True):
        value, error = fit.estimate(path)
        changes[path] = {
            "from": float(start),
            **estimate(fit, path),
            "significant": bool(abs(value - start) > MOVED * error),
        }
    return changes


def estimate(fit: Fitted, path: str) -> dict[str, Any]:
    """A parameter's value, 95 % interval and unit in files."""
    value, error = fit.estimate(path)
    return {
        "value": value,
        "low": value - 1.96 * error,
        "high": value + 1.96 * error,
        "unit": unit(path),
    }


def answer(
    verdict: str,
    effects: Sequence[Mapping[str, Any]] = (),
    parameters: Mapping[str, Any] | None = None,
    **more: object,
) -> dict[str, Any]:
    """An answer with the keys that `verdicts.compare` reads, and more that a reader may like."""
    return {
        "verdict": verdict,
        "effects": [
            {"name": each["name"], "confused_with": [], "parameters": {}} | dict(each)
            for each in effects
        ],
        "parameters": dict(parameters or {}),
        "gap": {},
        "not_identifiable": {},
        **more,
    }
