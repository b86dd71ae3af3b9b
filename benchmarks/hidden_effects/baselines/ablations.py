"""Ours, whole and with one part off.

A part is taken out by giving a module of the diagnosis another function in its place while one
diagnosis runs; the workflow stays the one that users run.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import Dataset
from pma_gym.discovery import diagnose, workflow
from pma_gym.discovery.fitting.free_parameters import FreeParameters
from pma_gym.discovery.preparation.noise import Whitening, white_noise
from pma_gym.discovery.screening import residuals, scan_statistic
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.selection import stages
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

HELD = 1e-3
"""Share of what parameters may be off by that is left to them where they are not refitted."""


def ours(dataset: Dataset, seed: int, jobs: int) -> Mapping[str, Any]:
    """The diagnosis as users run it."""
    return diagnose(dataset, seed=seed, jobs=jobs).document()


def no_whitening(dataset: Dataset, seed: int, jobs: int) -> Mapping[str, Any]:
    """Without the noise's memory: what a fit leaves counts as white noise of its variance."""
    with (
        _instead(residuals, "autoregression", _no_memory),
        _instead(scan_statistic, "autoregression", _no_memory),
    ):
        return ours(dataset, seed, jobs)


def no_refit(dataset: Dataset, seed: int, jobs: int) -> Mapping[str, Any]:
    """Without a refit: the model's own parameters stay as given, zeros of sensors are free."""
    own = workflow.free_parameters

    def held(model: Model) -> FreeParameters:
        answer = own(model)
        return replace(answer, prior=HELD * answer.prior)

    with _instead(workflow, "free_parameters", held):
        answer = ours(dataset, seed, jobs)
    # Parameters that were not free are neither off nor undetermined.
    return {**answer, "parameters": {}, "not_identifiable": {}}


def no_gate(dataset: Dataset, seed: int, jobs: int) -> Mapping[str, Any]:
    """Without the simulated chance: every effect passes that changes enough, as if sure."""
    whole = stages.screen

    def sure(*args: Any, **options: Any) -> list[ScreeningScore]:  # noqa: ANN401
        return [replace(each, p_value=0.0) for each in whole(*args, **options)]

    with _instead(stages, "screen", sure):
        return ours(dataset, seed, jobs)


def _no_memory(parts: Sequence[Array], level: float) -> Whitening:
    """White noise of what is left, never less than what is seen at rest."""
    every = np.concatenate([part[np.isfinite(part)] for part in parts])
    return white_noise(max(level, float(np.sqrt(np.mean(every**2)))))


@contextmanager
def _instead(module: object, name: str, other: object) -> Iterator[None]:
    """Another function in a module's place; AttributeError where it has none of that name."""
    with patch.object(module, name, other):
        yield
