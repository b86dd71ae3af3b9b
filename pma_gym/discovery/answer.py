"""Everything that a diagnosis says, from what its steps found."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.diagnosis import (
    ADDED,
    UNFITTED,
    Approximate,
    Candidate,
    Diagnosis,
    Estimate,
    Moved,
    NamedEffect,
    TrialRecord,
    Verdict,
)
from pma_gym.discovery.experiments.detectability import experiment_to_detect
from pma_gym.discovery.experiments.next_experiment import next_experiment
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import unit, values
from pma_gym.discovery.fitting.trial_states import misfits, trial_states
from pma_gym.discovery.preparation.quantisation import coarse_sensors
from pma_gym.discovery.report.approximate_text import why_approximate
from pma_gym.discovery.report.noise_text import nuisances
from pma_gym.discovery.report.range_text import widened_ranges
from pma_gym.discovery.report.records import floors_in_file_units, gaps, judgements, trial_records
from pma_gym.discovery.report.verdict_text import doubt, sentence, steps, twin, unidentified
from pma_gym.discovery.screening.localisation import localise
from pma_gym.discovery.screening.residuals import residuals
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.selection.backward_elimination import as_given
from pma_gym.discovery.selection.forward_selection import Stage, passes
from pma_gym.discovery.verdict.approximate import MOST_SCATTER, closing
from pma_gym.discovery.verdict.decision import suspicious, verdict_of
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.residual_fraction import residual_fraction, tones
from pma_gym.discovery.verdict.residual_laws import residual_law
from pma_gym.discovery.verdict.unknown import (
    Reason,
    shapeless_laws,
    telling,
    why_unknown,
    widest_scatter,
)
from pma_gym.discovery.verdict.worsened import worsened
from pma_gym.plant.model import Model
from pma_gym.plant.parameter_rows import Note

AT_LIMIT = 1e-6
"""Distance from an end of a range, as a share of the range, within which a value is at that end."""

BOUNDLESS = 1e3
"""Times the lower end of a positive range that count for its width, where it is wider."""

Progress = Callable[[str, int, int], None]

MOVED = 3.0
"""Standard errors by which a parameter must move to be said to have been off."""

DETERMINED = 0.7
"""A parameter whose standard error is a larger share of what was assumed of it beforehand is not
determined by the data."""

SILENT = 0.2
"""Share of the catalogue that would not have shown, from which on an experiment that would show it
is proposed although nothing seems to be missing."""


def answer(findings: Findings, tell: Progress, propose: bool = True) -> Diagnosis:
    """The diagnosis, with the next experiment if one is to be proposed."""
    tell("putting the answer together", 0, 3)
    coarse = coarse_sensors(findings.floors, _misfits(findings))
    left = residual_fraction(findings)
    laws = shapeless_laws(findings, left)
    not_detectable = tuple(
        score.candidate.name
        for score in findings.scores
        if score.resolvable is None or score.resolvable > 1.0
    )
    fit = findings.selection.fit
    parameters = (
        _moved(findings, fit)
        if findings.elimination is None
        else _off(findings, findings.elimination.fit)
    )
    off = any(moved.significant for moved in parameters.values())
    unknown = why_unknown(findings, left, laws)
    verdict = verdict_of(findings, unknown, not_detectable, bool(coarse), off)
    records = trial_records(findings)
    closes = closing(gaps(records), unknown.effects) if unknown and unknown.effects else None
    if closes is not None and closes.named and widest_scatter(findings) <= MOST_SCATTER:
        # An approximate law is a name where a right one would be; else the verdict stays.
        named = verdict_of(findings, None, not_detectable, bool(coarse), off)
        verdict = named if named == "effect" else verdict
    effects = (*_effects(findings), *coarse) if verdict == "effect" else ()
    model = _amended(findings, verdict)
    tell("putting the answer together", 1, 3)
    where, maps = localise(
        findings.problem.whitened_residuals(findings.refitted.model),
        findings.refitted,
        np.array([floor.level for floor in findings.floors]),
        findings.seed,
    )
    states = trial_states(*_proposal(findings, verdict), [each.name for each in findings.named])
    tell("putting the answer together", 2, 3)
    diagnosis = Diagnosis(
        verdict=verdict,
        sentence="",
        where=where,
        effects=effects,
        parameters=parameters,
        gap=gaps(records),
        candidates=_candidates(findings),
        next_experiment=_following(findings, verdict, not_detectable) if propose else None,
        model=model,
        given=findings.given,
        not_identifiable={
            path: why
            for path, why in _not_identifiable(findings, fit).items()
            if path not in parameters
        },
        not_detectable=not_detectable,
        approximate=(
            Approximate(_effects(findings), closes.left, closes.held_out)
            if closes is not None and closes.worth_saying
            else None
        ),
        law=residual_law(laws[0]) if unknown is not None and telling(findings, laws) else None,
        tones=tones(findings) if verdict == "unknown" else {},
        floors=floors_in_file_units(findings),
        nuisances=nuisances(findings),
        adequacy=judgements(findings),
        trials=records,
        states=states,
        written=misfits(findings.named, model, states),
        maps=maps,
        warnings=(*_warnings(findings), *_approximations(verdict, unknown)),
        converged=findings.proposed[1].converged,
        worsened=_worsened(findings, verdict, records),
    )
    reason = unknown if verdict == "unknown" else None
    return replace(
        diagnosis, sentence=sentence(diagnosis, reason), steps=steps(findings, diagnosis, left)
    )


def _approximations(verdict: Verdict, unknown: Reason | None) -> list[str]:
    """Why the law of what is named is only approximate."""
    return [why_approximate(unknown)] if verdict == "effect" and unknown is not None else []


def _effects(findings: Findings) -> tuple[NamedEffect, ...]:
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
                    path.partition(".")[2]: _estimate(findings, fit, path)
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


def _estimate(findings: Findings, fit: Fitted, path: str) -> Estimate:
    """A parameter's value and 95 % interval, within its bounds."""
    value, error = _known(findings, fit, path)
    lower, upper = _bounds(findings, fit)[path]
    limit = at_limit(value, lower, upper)
    if not np.isfinite(error):
        return Estimate(value, None, None, unit(path), limit)
    low, high = max(value - 1.96 * error, lower), min(value + 1.96 * error, upper)
    # A range may be a million times as wide as what a light axis has: what is surely off an end of
    # it is not at that end.
    limit = "" if lower < low and high < upper else limit
    return Estimate(value, low, high, unit(path), limit)


def at_limit(value: float, lower: float, upper: float) -> str:
    """Which end of its range a value is at: `lower`, `upper`, or none: empty."""
    reach = AT_LIMIT * (upper - lower)
    if value >= upper - reach:
        return "upper"
    # An upper end that is never reached says nothing of how near the lower one is.
    least = min(reach, BOUNDLESS * AT_LIMIT * lower) if lower > 0.0 else reach
    return "lower" if value <= lower + least else ""


def _bounds(findings: Findings, fit: Fitted) -> Mapping[str, tuple[float, float]]:
    """What the fit allows each of its parameters."""
    problem = findings.selection.problem
    if findings.elimination is not None and fit is findings.elimination.fit:
        problem = findings.elimination.problem
    chosen = findings.selection.chosen if fit is findings.selection.fit else ()
    whitened = problem.whitened_at(fit, chosen)
    pairs = zip(whitened.lower.tolist(), whitened.upper.tolist(), strict=True)
    return dict(zip((free.path for free in whitened.free), pairs, strict=True))


def _misfits(findings: Findings) -> list[float]:
    """What the refitted model leaves of each output (root mean square, SI), NaN if not measured."""
    left = residuals(
        findings.problem.whitened_residuals(findings.refitted.model), findings.refitted
    )
    joined = [np.concatenate([part[channel] for part in left]) for channel in range(len(left[0]))]
    known = [values[np.isfinite(values)] for values in joined]
    return [float(np.sqrt(np.mean(each**2))) if each.size else np.nan for each in known]


def _known(findings: Findings, fit: Fitted, path: str) -> tuple[float, float]:
    """A parameter's value and its standard error.

    Of the fewest that explain the trials, the error is no smaller than with all parameters free:
    that the others are exactly as they were given is likely, not known.
    """
    value, error = fit.estimate(path)
    if findings.elimination is not None:
        error = float(np.maximum(error, findings.selection.fit.estimate(path)[1]))
    return value, error


def _moved(findings: Findings, fit: Fitted) -> Mapping[str, Moved]:
    """The model's own parameters that moved, the surest first; those that did not are left out."""
    start = values(findings.given, findings.problem.own.free)
    moved = {}
    for path, before in zip(findings.problem.own.free, start, strict=True):
        value, error = fit.estimate(path)
        score = abs(value - before) / error if np.isfinite(error) and error > 0.0 else 0.0
        if score > 1.0:
            moved[path] = (
                score,
                Moved(float(before), _estimate(findings, fit, path), bool(score > MOVED)),
            )
    return {path: each for path, (_, each) in sorted(moved.items(), key=lambda item: -item[1][0])}


def _off(findings: Findings, fit: Fitted) -> Mapping[str, Moved]:
    """The fewest parameters that explain the trials, the surest first."""
    start = values(findings.given, fit.paths)
    moved = {
        path: Moved(float(before), _estimate(findings, fit, path), True)
        for path, before in zip(fit.paths, start, strict=True)
    }
    spread = dict(zip(fit.paths, np.sqrt(np.diag(fit.covariance)), strict=True))
    return dict(
        sorted(
            moved.items(),
            key=lambda item: -abs(item[1].now.value - item[1].start) / spread[item[0]],
        )
    )


def _not_identifiable(findings: Findings, fit: Fitted) -> Mapping[str, str]:
    """Parameters that the data do not determine, with the reason."""
    reasons = {}
    for path, prior in zip(findings.problem.own.free, findings.problem.own.prior, strict=True):
        _, error = fit.estimate(path)
        if not np.isfinite(error) or error > DETERMINED * prior:
            reasons[path] = unidentified(path, fit, findings.problem.own)
    return reasons


def _candidates(findings: Findings) -> tuple[Candidate, ...]:
    """The whole catalogue, what was added first, then by what each could explain."""
    if not findings.selection.stages:
        return ()
    stage = findings.selection.stages[0]
    chosen = [candidate.name for candidate in findings.selection.chosen]
    gains = _held_out_gains(findings)
    listed = []
    for each in stage.scores:
        name = each.candidate.name
        fit = stage.fits.get(name)
        gain = each.gain if fit is None else stage.before.chi_square - fit.chi_square
        candidate = Candidate(
            name=name,
            delta_log_likelihood=0.5 * gain,
            held_out_gain=gains.get(name),
            p_value=each.p_value,
            change=each.change,
            resolvable=each.resolvable,
            fitted=fit is not None,
            why=_why(findings, each, name in chosen),
        )
        listed.append(candidate)
    return tuple(
        sorted(listed, key=lambda c: (c.name not in chosen, not c.fitted, -c.delta_log_likelihood))
    )


def _why(findings: Findings, score: ScreeningScore, chosen: bool) -> str:
    name = score.candidate.name
    if chosen:
        return ADDED
    for candidate, rivals in zip(findings.selection.chosen, findings.rivals, strict=True):
        for rival in rivals:
            if rival.candidate.name == name:
                if rival.equal:
                    return f"explains these data as well as {candidate.name}"
                return (
                    f"explains less than {candidate.name}, by a log-likelihood of "
                    f"{rival.behind / 2:.4g}"
                )
    if name in findings.selection.stages[-1].unfitted:
        return UNFITTED
    if score.resolvable is None:
        return "these data could not show it at any size"
    if not passes(findings.problem, score):
        if score.resolvable > 1.0:
            return f"would show from {score.resolvable:.2g} times its usual size on only"
        return "explains no more than chance would"
    return "explains less than what was added"


def _held_out_gains(findings: Findings) -> Mapping[str, float]:
    """Gain in log-likelihood a reading on trials left out, for what was added."""
    if findings.unseen is None or findings.unseen_without is None or not findings.selection.chosen:
        return {}
    gain = findings.unseen_without.chi_square.sum() - findings.unseen.chi_square.sum()
    count = sum(
        logged.count for logged in findings.problem.whitened_residuals(findings.given).logged
    )
    return {candidate.name: float(0.5 * gain / count) for candidate in findings.selection.chosen}


def _proposal(
    findings: Findings, verdict: Verdict
) -> tuple[FitProblem, Fitted, tuple[CandidateEffect, ...]]:
    """The fit of the model that is proposed, on which bench, with which effects."""
    if verdict == "agrees":
        given = as_given(findings.problem)
        return given.problem, given.fit, ()
    if findings.elimination is not None:
        return findings.elimination.problem, findings.elimination.fit, ()
    if verdict in ("effect", "unknown"):
        return findings.selection.problem, findings.selection.fit, findings.selection.chosen
    return findings.problem, findings.refitted, ()


def _amended(findings: Findings, verdict: Verdict) -> Model:
    """The model with what was found, its intervals in its notes."""
    fit = _proposal(findings, verdict)[1]
    if not fit.paths:
        return findings.given
    notes = dict(fit.model.notes)
    for path in fit.paths:
        value, error = _known(findings, fit, path)
        known = bool(np.isfinite(error))
        notes[path] = Note(
            f"fitted to {len(findings.named)} trials by pma_gym.discovery",
            value - 1.96 * error if known else None,
            value + 1.96 * error if known else None,
        )
    for path in findings.selection.undetermined if verdict in ("effect", "unknown") else ():
        notes[path] = Note("not determined by the trials: held where its law is at a limit")
    return replace(
        fit.model,
        name=f"{findings.given.name}_amended",
        title=f"{findings.given.title}; amended by a diagnosis",
        notes=notes,
    )


def _following(findings: Findings, verdict: Verdict, not_detectable: Sequence[str]):  # noqa: ANN202
    """What to measure next: what tells the survivors apart, or shows what could not be seen."""
    problem, selection = findings.selection.problem, findings.selection
    for place, rivals in enumerate(findings.rivals):
        equal = [rival for rival in rivals if rival.equal][:3]
        if equal:
            others = [
                (
                    rival.fit,
                    tuple(
                        rival.candidate if i == place else candidate
                        for i, candidate in enumerate(selection.chosen)
                    ),
                )
                for rival in equal
            ]
            return next_experiment(
                problem, [(selection.fit, selection.chosen), *others], findings.seed
            )
    if verdict == "undecidable" and selection.chosen:
        # Not borne out by trials left out: is it there, or nothing? Both beside the same noise.
        plain = problem.fit(findings.refitted.model) or findings.refitted
        pair = [(selection.fit, selection.chosen), (plain, ())]
        following = next_experiment(problem, pair, findings.seed)
        if following is not None:
            return following
    silent = verdict in ("parameters", "agrees") and len(not_detectable) > SILENT * len(
        findings.candidates
    )
    if (verdict == "undecidable" or silent) and findings.scores:
        worth = [
            score.candidate
            for score in (findings.scores[:3] if suspicious(findings) else findings.scores)
        ]
        return experiment_to_detect(findings.problem, findings.refitted, worth, findings.scores)
    return None


def _worsened(
    findings: Findings, verdict: Verdict, records: Sequence[TrialRecord]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What the proposed model fits worse than the given one; nothing where none is proposed."""
    if verdict not in ("effect", "parameters"):
        return (), ()
    levels = {
        BY_QUANTITY[name].name: findings.adequacy.signals[name].floor
        for name in findings.adequacy.signals
    }
    floors = {floor.signal.column: floor.level for floor in findings.floors}
    floors |= {signal: floor.level for signal, floor in levels.items() if floor is not None}
    return worsened(records, floors, findings.seed)


def _doubts(findings: Findings) -> list[str]:
    """Of named parameters, those that another could stand for, or that the trials hardly hold."""
    if findings.elimination is None:
        return []
    named, free = findings.elimination.fit.paths, findings.selection.fit
    unsure = _not_identifiable(findings, free)
    surely = [path for path, moved in _moved(findings, free).items() if moved.significant]
    return [
        doubt(path, free, findings.problem.own)
        for path in named
        if path in unsure or (path not in surely and twin(path, free) not in (None, *named))
    ]


def _warnings(findings: Findings) -> tuple[str, ...]:
    words = [*_doubts(findings), *widened_ranges(findings.problem, findings.proposed[1])]
    if findings.discarded is not None:
        given, refitted = findings.discarded
        words.append(
            f"a refit was discarded: it raises the whitened sum of squares of the readings that it "
            f"was fitted to, from {given:.5g} to {refitted:.5g}"
        )
    if not findings.proposed[1].converged:
        words.append("the last fit stopped before it had converged; its intervals are rough")
    if findings.unseen is None:
        words.append(
            "with one trial nothing can be left out: the gap after the amendment is that of the "
            "data it was fitted to"
        )
    return tuple(words)
