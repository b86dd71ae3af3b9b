"""Estimates and their intervals, from the fits of a diagnosis."""

from collections.abc import Mapping, Sequence

import numpy as np

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import Fitted
from pma_gym.discovery.fitting.free_parameters import at_limit, unit
from pma_gym.discovery.result.estimates import Covariance, Estimate, NamedEffect, RivalModel
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.selection.stages import Stage
from pma_gym.discovery.thresholds import CONFIDENCE, LEAST_GAIN
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.plant.model import Model, ModelError


def selected_effects(findings: Findings) -> tuple[NamedEffect, ...]:
    """The effects that were selected."""
    fit, effects = findings.selection.fit, []
    for place, candidate in enumerate(findings.selection.chosen):
        stage = findings.selection.stages[min(place, len(findings.selection.stages) - 1)]
        score = next(each for each in stage.scores if each.candidate.name == candidate.name)
        equal = [rival.candidate.name for rival in findings.rivals[place] if rival.equal]
        effects.append(
            NamedEffect(
                name=candidate.name,
                confused_with=tuple(equal),
                p_value=_p_value(stage, score),
                parameters={
                    path.partition(".")[2]: estimate(findings, fit, path)
                    for path in candidate.fitted_paths
                },
                undetermined={
                    path.partition(".")[2]: findings.selection.undetermined[path]
                    for path in candidate.left
                },
            )
        )
    return tuple(effects)


def _p_value(stage: Stage, score: ScreeningScore) -> float:
    """Family-wise p-value of the fit of a named effect, or what opened the gate for it."""
    fit = stage.fits.get(score.candidate.name)
    if fit is None or stage.scan.excess:
        return score.p_value
    return score.p_value_of(stage.before.chi_square - fit.chi_square)


def estimate(findings: Findings, fit: Fitted, path: str) -> Estimate:
    """A parameter's value and 95 % interval, within its bounds."""
    value, error = value_and_error(findings, fit, path)
    lower, upper = _bounds(findings, fit)[path]
    limit = at_limit(value, lower, upper)
    if not np.isfinite(error):
        return Estimate(value, None, None, unit(path), limit)
    low, high = fit.interval(path, error)
    shifts = _shifts_beside(findings, fit, path)
    low, high = min(low, value + min(shifts)), max(high, value + max(shifts))
    low, high = max(low, lower), min(high, upper)
    # A range may be a million times as wide as what a light axis has: what is surely off an end of
    # it is not at that end, whatever another law makes of it.
    limit = (
        "" if lower < value - CONFIDENCE * error and value + CONFIDENCE * error < upper else limit
    )
    return Estimate(value, low, high, unit(path), limit)


def _shifts_beside(findings: Findings, fit: Fitted, path: str) -> list[float]:
    """How far a parameter moves where a further effect stands beside the selected ones; and 0.

    An effect that explains as much as one that is added must, but was not worth a name, may still
    be there.
    """
    selection = findings.selection
    names = tuple(each.name for each in selection.chosen)
    if fit is not selection.fit or not names:
        return [0.0]
    last = selection.stages[-1]
    if last.before.names != names or path not in last.before.paths:
        return [0.0]
    more = [
        beside
        for beside in last.fits.values()
        if last.before.chi_square - beside.chi_square >= LEAST_GAIN and path in beside.paths
    ]
    here = last.before.estimate(path)[0]
    return [0.0, *(beside.estimate(path)[0] - here for beside in more)]


def _bounds(findings: Findings, fit: Fitted) -> Mapping[str, tuple[float, float]]:
    """What the fit allows each of its parameters."""
    problem = findings.selection.problem
    if findings.elimination is not None and fit is findings.elimination.fit:
        problem = findings.elimination.problem
    chosen = findings.selection.chosen if fit is findings.selection.fit else ()
    whitened = problem.whitened_at(fit, chosen)
    pairs = zip(whitened.lower.tolist(), whitened.upper.tolist(), strict=True)
    return dict(zip((free.path for free in whitened.free), pairs, strict=True))


def value_and_error(findings: Findings, fit: Fitted, path: str) -> tuple[float, float]:
    """A parameter's value and its standard error.

    Of the fewest that explain the trials, the error is no smaller than with all parameters free:
    that the others are exactly as they were given is likely, not known.
    """
    value, error = fit.estimate(path)
    if findings.elimination is not None:
        error = float(np.maximum(error, findings.selection.fit.estimate(path)[1]))
    return value, error


def covariance_of(findings: Findings, fit: Fitted) -> Covariance:
    """Of a fit's parameters, with the standard errors of `value_and_error`."""
    errors = [value_and_error(findings, fit, path)[1] for path in fit.paths]
    return Covariance.of(fit.paths, errors, fit.covariance)


def rival_models(findings: Findings, written: Model) -> tuple[RivalModel, ...]:
    """Models that explain the data as well as the written one.

    With rivals of its effects; with the selected effects, where they are not written.
    """
    chosen, fit = findings.selection.chosen, findings.selection.fit
    fits = [(fit, chosen)] if not {c.effect for c in chosen} <= {*written.parameters} else []
    for place, rivals in enumerate(findings.rivals):
        fits += [
            (rival.fit, (*chosen[:place], rival.candidate, *chosen[place + 1 :]))
            for rival in rivals
            if rival.equal
        ]
    models = (
        rival_model(
            *(effects, chosen, written, each.model),
            Covariance.of(each.paths, np.sqrt(np.diag(each.covariance)).tolist(), each.covariance),
        )
        for each, effects in fits
    )
    return tuple(model for model in models if model is not None)


def rival_model(
    effects: Sequence[CandidateEffect],
    replaced: Sequence[CandidateEffect],
    written: Model,
    fitted: Model,
    covariance: Covariance,
) -> RivalModel | None:
    """A rival as it stands beside the written model; None where no rig takes the effects of both.

    Args:
        effects: of the rival.
        replaced: of the written model, which do nothing in the rival unless it has them too.
        written: the written model.
        fitted: the rival's.
        covariance: of its parameters.
    """
    both, alone = written, fitted
    try:
        for each in effects:
            both = each.beside(both)
        for each in replaced:
            alone = each.beside(alone)
    except ModelError:
        return None
    values = {
        f"{effect}.{key}": value
        for effect in both.parameters
        if effect in alone.parameters
        for key, value in alone.values_in_files(effect).items()
        if value != both.values_in_files(effect)[key]
    }
    added = [each for each in both.parameters if each not in written.parameters]
    absent = {each: both.values_in_files(each) for each in added}
    return RivalModel(" and ".join(each.name for each in effects), absent, values, covariance)
