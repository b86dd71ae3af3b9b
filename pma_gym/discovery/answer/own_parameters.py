"""The model's own parameters: those that moved, those that are off, those left undetermined."""

from collections.abc import Mapping

import numpy as np

from pma_gym.discovery.answer.estimates import estimate
from pma_gym.discovery.fitting.fit_problem import Fitted
from pma_gym.discovery.fitting.free_parameters import values
from pma_gym.discovery.report.verdict_text import doubt, twin, unidentified
from pma_gym.discovery.result.estimates import Moved
from pma_gym.discovery.thresholds import DETERMINED, SURE
from pma_gym.discovery.verdict.findings import Findings


def moved_parameters(findings: Findings, fit: Fitted) -> Mapping[str, Moved]:
    """The model's own parameters that moved, the surest first; those that did not are left out."""
    start = values(findings.given, findings.problem.own.free)
    moved = {}
    for path, before in zip(findings.problem.own.free, start, strict=True):
        value, error = fit.estimate(path)
        score = abs(value - before) / error if np.isfinite(error) and error > 0.0 else 0.0
        if score > 1.0:
            moved[path] = (
                score,
                Moved(float(before), estimate(findings, fit, path), bool(score > SURE)),
            )
    return {path: each for path, (_, each) in sorted(moved.items(), key=lambda item: -item[1][0])}


def parameters_off(findings: Findings, fit: Fitted) -> Mapping[str, Moved]:
    """The fewest parameters that explain the trials, the surest first."""
    start = values(findings.given, fit.paths)
    moved = {
        path: Moved(float(before), estimate(findings, fit, path), True)
        for path, before in zip(fit.paths, start, strict=True)
    }
    spread = dict(zip(fit.paths, np.sqrt(np.diag(fit.covariance)), strict=True))
    return dict(
        sorted(
            moved.items(),
            key=lambda item: -abs(item[1].now.value - item[1].start) / spread[item[0]],
        )
    )


def not_identifiable(findings: Findings, fit: Fitted) -> Mapping[str, str]:
    """Parameters that the data do not determine, with the reason."""
    reasons = {}
    for path, prior in zip(findings.problem.own.free, findings.problem.own.prior, strict=True):
        _, error = fit.estimate(path)
        if not np.isfinite(error) or error > DETERMINED * prior:
            reasons[path] = unidentified(path, fit, findings.problem.own)
    return reasons


def doubts(findings: Findings) -> list[str]:
    """Of named parameters, those that another could stand for, or that the trials hardly hold."""
    if findings.elimination is None:
        return []
    named, free = findings.elimination.fit.paths, findings.selection.fit
    unsure = not_identifiable(findings, free)
    surely = [path for path, moved in moved_parameters(findings, free).items() if moved.significant]
    return [
        doubt(path, free, findings.problem.own)
        for path in named
        if path in unsure or (path not in surely and twin(path, free) not in (None, *named))
    ]
