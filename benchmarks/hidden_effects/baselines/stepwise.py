"""Plain BIC stepwise: effects are added while Schwarz's criterion falls, and that is all.

Residuals are taken for white noise of the variance that they have, which a wrong model's residuals
are not: they resemble themselves for a second, and count as hundreds of independent readings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.hidden_effects.baselines.preparation import (
    Prepared,
    answer,
    estimate,
    moved,
    noise_of,
    prepare,
)
from pma_gym.data.datasets.dataset import Dataset
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import values
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.residuals import simulated_less_measured
from pma_gym.discovery.screening.score_test import screen
from pma_gym.discovery.screening.starting_points import starting_points
from pma_gym.discovery.selection.forward_selection import MOST_EFFECTS
from pma_gym.discovery.selection.tried_candidates import NEAR, TRIED

Array = NDArray[np.float64]


def bic(squares: Sequence[float], counts: Sequence[int], parameters: int) -> float:
    """Schwarz's criterion of Gaussian residuals, the variance of each signal unknown.

        BIC = sum of n log(RSS / n) over signals + k log(sum of n)

    Args:
        squares: sums of squared residuals RSS of each signal.
        counts: how many residuals n each has; one without any does not count.
        parameters: how many were fitted, k.
    Source:
        Schwarz 1978, Annals of Statistics 6, 461-464.
    """
    pairs = [(square, n) for square, n in zip(squares, counts, strict=True) if n]
    fit = sum(n * np.log(square / n) for square, n in pairs)
    return float(fit + parameters * np.log(sum(n for _, n in pairs)))


def bic_stepwise(dataset: Dataset, seed: int, jobs: int) -> Mapping[str, Any]:
    """Effects of the catalogue, added one by one while the criterion falls."""
    ready = prepare(dataset, jobs)
    problem = noise_of(ready.left, ready.problem)
    best = problem.fit(ready.refitted.model) or ready.refitted
    least = _bic_of(problem, best, (), problem.own.free)
    chosen: tuple[CandidateEffect, ...] = ()
    while len(chosen) < MOST_EFFECTS:
        candidate = _tried(problem, best, chosen, ready, seed)
        added, fit, value = min(candidate, key=lambda each: each[2], default=(None, best, np.inf))
        if added is None or value >= least:
            break
        chosen, best, least = (*chosen, added), fit, value
    parameters = moved(problem, best)
    effects = [
        {
            "name": each.name,
            "parameters": {path.partition(".")[2]: estimate(best, path) for path in each.paths
                           if path in best.paths},
        }
        for each in chosen
    ]  # fmt: skip
    if chosen:
        return answer("effect", effects, parameters, bic=least)
    return answer(
        "parameters" if _off(problem, best, least) else "agrees", (), parameters, bic=least
    )


def _tried(
    problem: FitProblem,
    best: Fitted,
    chosen: tuple[CandidateEffect, ...],
    ready: Prepared,
    seed: int,
) -> list[tuple[CandidateEffect, Fitted, float]]:
    """The candidates that look best beside a fit, each fitted, with its criterion."""
    baseline = Baseline.at(problem.whitened_residuals(best.model, chosen), best.values, best.steps)
    plain = problem.given.replace({path: best.estimate(path)[0] for path in problem.own.free})
    taken = {each.name for each in chosen}
    rest = [each for each in ready.catalogue if each.name not in taken]
    scores = screen(baseline, rest, seed, lambda each: problem.probed(plain, each))
    scores.sort(key=lambda each: -each.gain)
    candidates = []
    worth = [each for each in scores if each.starts and each.gain > NEAR * scores[0].gain]
    for each in worth[:TRIED]:
        begun = starting_points(baseline, problem.probed(plain, each.candidate), each)[0]
        extra = (*chosen, each.candidate)
        fit = problem.fit(best.model, extra, {each.candidate.name: begun})
        if fit is not None:
            candidates.append((each.candidate, fit, _bic_of(problem, fit, extra, fit.paths)))
    return candidates


def _bic_of(
    problem: FitProblem, fit: Fitted, extra: Sequence[CandidateEffect], fitted: Sequence[str]
) -> float:  # fmt: skip
    whitened = problem.whitened_residuals(fit.model, extra)
    readings = whitened.readings(fit.values)
    if readings is None:
        return float("inf")
    left = simulated_less_measured(whitened, readings)
    known = [np.concatenate([part[c][np.isfinite(part[c])] for part in left]) for c in range(4)]
    return bic([float(each @ each) for each in known], [len(each) for each in known], len(fitted))


def _off(problem: FitProblem, fit: Fitted, value: float) -> bool:
    """Whether refitted parameters, which count, are better than those that were given."""
    given = replace(fit, model=problem.given, values=values(problem.given, problem.own.free))
    return value < _bic_of(problem, given, (), ())
