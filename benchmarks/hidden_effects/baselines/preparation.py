"""What every way starts from: a data set beside its model, whose own parameters are refitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import Dataset
from pma_gym.discovery.answer import MOVED
from pma_gym.discovery.fitting.candidate_effect import Suspect
from pma_gym.discovery.fitting.fit_problem import Bench, Fitted
from pma_gym.discovery.fitting.free_parameters import own_parameters, unit, values
from pma_gym.discovery.preparation.initial_floors import Level, initial_floors
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.whitened_residuals import Evidence
from pma_gym.discovery.screening.candidates import suspects
from pma_gym.discovery.screening.residuals import left_over
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import load_model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prepared:
    """A data set beside its model.

    Attributes:
        bench: the trials, their noise taken for white.
        refitted: the model with its own parameters refitted.
        evidence: the trials beside it.
        readings: what its sensors hold (SI), shape (4, rows) for each trial.
        left: those less what was measured, free zeros taken out, in standard deviations of the
            noise; NaN where nothing was measured.
        floors: noise of the four outputs.
        orders: which repeat each trial is, or None.
    """

    bench: Bench
    refitted: Fitted
    evidence: Evidence
    readings: Sequence[Array]
    left: Sequence[Array]
    floors: Sequence[Level]
    orders: Sequence[float] | None

    @property
    def catalogue(self) -> list[Suspect]:
        """Every effect that the model lacks."""
        return suspects(self.bench.given, self.orders)

    @property
    def moved(self) -> bool:
        """Whether a parameter left the value that was given by more than its error."""
        return any(each["significant"] for each in moved(self.bench, self.refitted).values())


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
    bench = Bench(trials, given, own_parameters(given), noise, threads)
    refitted = bench.careful_fit(given)
    if refitted is None:
        raise ValueError(
            f"model {given.name} cannot be simulated on the trials of {dataset.title}: its muscle "
            "does not balance the load where one begins; check the units of the commands"
        )
    evidence = bench.evidence(refitted.model)
    readings = evidence.readings(refitted.values)
    assert readings is not None
    levels = np.array([floor.level for floor in floors])[:, None]
    left = [part / levels for part in left_over(evidence, readings)]
    orders = [named.order for named in dataset.trials]
    known = None if None in orders else [float(order or 0.0) for order in orders]
    return Prepared(bench, refitted, evidence, readings, left, floors, known)


def noise_of(left: Sequence[Array], bench: Bench) -> Bench:
    """The same bench with white noise of the variance that a residual has (rms, by output)."""
    squares = [np.nanmean(np.concatenate([part[c] ** 2 for part in left])) for c in range(4)]
    noise = tuple(
        white_noise(before.level * float(np.sqrt(square))) if np.isfinite(square) else before
        for before, square in zip(bench.noise, squares, strict=True)
    )
    return replace(bench, noise=noise)


def moved(bench: Bench, fit: Fitted) -> dict[str, dict[str, Any]]:
    """The model's own parameters and by how much they moved, as `diagnosis.json` has them."""
    found = {}
    for path, start in zip(bench.own.free, values(bench.given, bench.own.free), strict=True):
        value, error = fit.estimate(path)
        found[path] = {
            "from": float(start),
            **estimate(fit, path),
            "significant": bool(abs(value - start) > MOVED * error),
        }
    return found


def estimate(fit: Fitted, path: str) -> dict[str, Any]:
    """A parameter's value, 95 % interval and unit at the door."""
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
