"""Everything that a diagnosis says, from what its steps found."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.diagnosis import (
    ADDED,
    Approximate,
    Candidate,
    Diagnosis,
    Estimate,
    Moved,
    NamedEffect,
    TrialRecord,
    Verdict,
)
from pma_gym.discovery.experiments.detectability import for_blind
from pma_gym.discovery.experiments.next_experiment import next_experiment
from pma_gym.discovery.fitting.candidate_effect import Suspect
from pma_gym.discovery.fitting.fit_problem import Bench, Fitted
from pma_gym.discovery.fitting.free_parameters import unit, values
from pma_gym.discovery.fitting.trial_states import misfits, trial_states
from pma_gym.discovery.preparation.quantisation import coarse_sensors
from pma_gym.discovery.report.approximate_text import why_approximate
from pma_gym.discovery.report.range_text import widened_ranges
from pma_gym.discovery.report.records import floors_at_the_door, gaps, judgements, trial_records
from pma_gym.discovery.report.verdict_text import doubt, sentence, steps, twin, unidentified
from pma_gym.discovery.screening.localisation import localise
from pma_gym.discovery.screening.residuals import residuals
from pma_gym.discovery.screening.score_test import Look
from pma_gym.discovery.selection.backward_elimination import as_given
from pma_gym.discovery.selection.forward_selection import passes
from pma_gym.discovery.verdict.approximate import closing
from pma_gym.discovery.verdict.decision import suspicious, verdict_of
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.residual_fraction import leftover, tones
from pma_gym.discovery.verdict.residual_laws import residual_law
from pma_gym.discovery.verdict.unknown import Reason, shapeless_laws, telling, why_unknown
from pma_gym.discovery.verdict.worsened import worsened
from pma_gym.plant.compiled_model import OUTPUTS
from pma_gym.plant.model import Model, Note

AT_LIMIT = 1e-6
"""Distance from an end of a range, as a share of the range, within which a value is at that end."""

Progress = Callable[[str, int, int], None]

MOVED = 3.0
"""Standard errors by which a parameter must move to be said to have been off."""

DETERMINED = 0.7
"""A parameter whose standard error is a larger share of what was assumed of it beforehand is not
determined by the data."""

SILENT = 0.2
"""Share of the catalogue that would not have shown, from which on an experiment that would show it
is proposed although nothing seems to be missing."""


def answer(found: Findings, tell: Progress, propose: bool = True) -> Diagnosis:
    """The diagnosis, with the next experiment if one is to be proposed."""
    tell("putting the answer together", 0, 3)
    coarse = coarse_sensors(found.floors, _misfits(found))
    left = leftover(found)
    laws = shapeless_laws(found, left)
    blind = tuple(
        look.suspect.name
        for look in found.looks
        if look.resolvable is None or look.resolvable > 1.0
    )
    fit = found.selection.fit
    parameters = _moved(found, fit) if found.fewest is None else _off(found, found.fewest.fit)
    off = any(moved.significant for moved in parameters.values())
    unknown = why_unknown(found, left, laws)
    verdict = verdict_of(found, unknown, blind, bool(coarse), off)
    records = trial_records(found)
    count = 0 if unknown is None else len(unknown.effects)
    closes = closing(gaps(records), count) if count else None
    if closes is not None and closes.named:
        # An approximate law is a name where a right one would be; else the verdict stays.
        named = verdict_of(found, None, blind, bool(coarse), off)
        verdict = named if named == "effect" else verdict
    effects = (*_effects(found), *coarse) if verdict == "effect" else ()
    model = _amended(found, verdict)
    tell("putting the answer together", 1, 3)
    where, maps = localise(
        found.bench.evidence(found.refitted.model),
        found.refitted,
        np.array([floor.level for floor in found.floors]),
        found.seed,
    )
    states = trial_states(*_proposal(found, verdict), [each.name for each in found.named])
    tell("putting the answer together", 2, 3)
    diagnosis = Diagnosis(
        verdict=verdict,
        sentence="",
        where=where,
        effects=effects,
        parameters=parameters,
        gap=gaps(records),
        candidates=_candidates(found),
        next_experiment=_following(found, verdict, blind) if propose else None,
        model=model,
        given=found.given,
        not_identifiable={
            path: why
            for path, why in _not_identifiable(found, fit).items()
            if path not in parameters
        },
        blind=blind,
        approximate=(
            Approximate(_effects(found), closes.left, closes.held_out)
            if closes is not None and closes.worth_saying
            else None
        ),
        law=residual_law(laws[0]) if unknown is not None and telling(found, laws) else None,
        tones=tones(found) if verdict == "unknown" else {},
        floors=floors_at_the_door(found),
        adequacy=judgements(found),
        trials=records,
        states=states,
        written=misfits(found.named, model, states),
        maps=maps,
        warnings=(*_warnings(found), *_approximations(verdict, unknown)),
        converged=found.proposed[1].converged,
        worsened=_worsened(found, verdict, records),
    )
    reason = unknown if verdict == "unknown" else None
    return replace(
        diagnosis, sentence=sentence(diagnosis, reason), steps=steps(found, diagnosis, left)
    )


def _approximations(verdict: Verdict, unknown: Reason | None) -> list[str]:
    """Why the law of what is named is only approximate."""
    return [why_approximate(unknown)] if verdict == "effect" and unknown is not None else []


def _effects(found: Findings) -> tuple[NamedEffect, ...]:
    """The effects that were selected."""
    fit, effects = found.selection.fit, []
    for place, suspect in enumerate(found.selection.chosen):
        stage = found.selection.stages[min(place, len(found.selection.stages) - 1)]
        look = next(each for each in stage.looks if each.suspect.name == suspect.name)
        equal = [rival.suspect.name for rival in found.rivals[place] if rival.equal]
        effects.append(
            NamedEffect(
                name=suspect.name,
                confused_with=tuple(equal),
                p_value=look.p_value,
                parameters={
                    path.partition(".")[2]: _estimate(found, fit, path)
                    for path in suspect.fitted_paths
                },
                undetermined={
                    path.partition(".")[2]: found.selection.undetermined[path]
                    for path in suspect.left
                },
            )
        )
    return tuple(effects)


def _estimate(found: Findings, fit: Fitted, path: str) -> Estimate:
    """A parameter's value and 95 % interval, within its bounds."""
    value, error = _known(found, fit, path)
    lower, upper = _bounds(found, fit)[path]
    limit = at_limit(value, lower, upper)
    if not np.isfinite(error):
        return Estimate(value, None, None, unit(path), limit)
    low, high = max(value - 1.96 * error, lower), min(value + 1.96 * error, upper)
    return Estimate(value, low, high, unit(path), limit)


def at_limit(value: float, lower: float, upper: float) -> str:
    """Which end of its range a value is at: `lower`, `upper`, or none: empty."""
    reach = AT_LIMIT * (upper - lower)
    if value >= upper - reach:
        return "upper"
    return "lower" if value <= lower + reach else ""


def _bounds(found: Findings, fit: Fitted) -> Mapping[str, tuple[float, float]]:
    """What the fit allows each of its parameters."""
    bench = found.selection.bench
    if found.fewest is not None and fit is found.fewest.fit:
        bench = found.fewest.bench
    chosen = found.selection.chosen if fit is found.selection.fit else ()
    evidence = bench.evidence_of(fit, chosen)
    pairs = zip(evidence.lower.tolist(), evidence.upper.tolist(), strict=True)
    return dict(zip((free.path for free in evidence.free), pairs, strict=True))


def _misfits(found: Findings) -> list[float]:
    """What the refitted model leaves of each output (root mean square, SI), NaN if not measured."""
    left = residuals(found.bench.evidence(found.refitted.model), found.refitted)
    joined = [np.concatenate([part[channel] for part in left]) for channel in range(len(OUTPUTS))]
    known = [values[np.isfinite(values)] for values in joined]
    return [float(np.sqrt(np.mean(each**2))) if each.size else np.nan for each in known]


def _known(found: Findings, fit: Fitted, path: str) -> tuple[float, float]:
    """A parameter's value and its standard error.

    Of the fewest that explain the trials, the error is no smaller than with all parameters free:
    that the others are exactly as they were given is likely, not known.
    """
    value, error = fit.estimate(path)
    if found.fewest is not None:
        error = float(np.maximum(error, found.selection.fit.estimate(path)[1]))
    return value, error


def _moved(found: Findings, fit: Fitted) -> Mapping[str, Moved]:
    """The model's own parameters that moved, the surest first; those that did not are left out."""
    start = values(found.given, found.bench.own.free)
    moved = {}
    for path, before in zip(found.bench.own.free, start, strict=True):
        value, error = fit.estimate(path)
        score = abs(value - before) / error if np.isfinite(error) and error > 0.0 else 0.0
        if score > 1.0:
            moved[path] = (
                score,
                Moved(float(before), _estimate(found, fit, path), bool(score > MOVED)),
            )
    return {path: each for path, (_, each) in sorted(moved.items(), key=lambda item: -item[1][0])}


def _off(found: Findings, fit: Fitted) -> Mapping[str, Moved]:
    """The fewest parameters that explain the trials, the surest first."""
    start = values(found.given, fit.paths)
    moved = {
        path: Moved(float(before), _estimate(found, fit, path), True)
        for path, before in zip(fit.paths, start, strict=True)
    }
    spread = dict(zip(fit.paths, np.sqrt(np.diag(fit.covariance)), strict=True))
    return dict(
        sorted(
            moved.items(),
            key=lambda item: -abs(item[1].now.value - item[1].start) / spread[item[0]],
        )
    )


def _not_identifiable(found: Findings, fit: Fitted) -> Mapping[str, str]:
    """Parameters that the data do not determine, with the reason."""
    reasons = {}
    for path, prior in zip(found.bench.own.free, found.bench.own.prior, strict=True):
        _, error = fit.estimate(path)
        if not np.isfinite(error) or error > DETERMINED * prior:
            reasons[path] = unidentified(path, fit, found.bench.own)
    return reasons


def _candidates(found: Findings) -> tuple[Candidate, ...]:
    """The whole catalogue, what was added first, then by what each could explain."""
    if not found.selection.stages:
        return ()
    stage = found.selection.stages[0]
    chosen = [suspect.name for suspect in found.selection.chosen]
    gains = _held_out_gains(found)
    listed = []
    for each in stage.looks:
        name = each.suspect.name
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
            why=_why(found, each, name in chosen),
        )
        listed.append(candidate)
    return tuple(
        sorted(listed, key=lambda c: (c.name not in chosen, not c.fitted, -c.delta_log_likelihood))
    )


def _why(found: Findings, look: Look, chosen: bool) -> str:
    name = look.suspect.name
    if chosen:
        return ADDED
    for suspect, rivals in zip(found.selection.chosen, found.rivals, strict=True):
        for rival in rivals:
            if rival.suspect.name == name:
                if rival.equal:
                    return f"explains these data as well as {suspect.name}"
                return (
                    f"explains less than {suspect.name}, by a log-likelihood of "
                    f"{rival.behind / 2:.4g}"
                )
    if look.resolvable is None:
        return "these data could not show it at any size"
    if not passes(found.bench, look):
        if look.resolvable > 1.0:
            return f"would show from {look.resolvable:.2g} times its usual size on only"
        return "explains no more than chance would"
    return "explains less than what was added"


def _held_out_gains(found: Findings) -> Mapping[str, float]:
    """Gain in log-likelihood a reading on trials left out, for what was added."""
    if found.unseen is None or found.unseen_without is None or not found.selection.chosen:
        return {}
    gain = found.unseen_without.chi_square.sum() - found.unseen.chi_square.sum()
    count = sum(logged.count for logged in found.bench.evidence(found.given).logged)
    return {suspect.name: float(0.5 * gain / count) for suspect in found.selection.chosen}


def _proposal(found: Findings, verdict: Verdict) -> tuple[Bench, Fitted, tuple[Suspect, ...]]:
    """The fit of the model that is proposed, on which bench, with which effects."""
    if verdict == "agrees":
        given = as_given(found.bench)
        return given.bench, given.fit, ()
    if found.fewest is not None:
        return found.fewest.bench, found.fewest.fit, ()
    if verdict in ("effect", "unknown"):
        return found.selection.bench, found.selection.fit, found.selection.chosen
    return found.bench, found.refitted, ()


def _amended(found: Findings, verdict: Verdict) -> Model:
    """The model with what was found, its intervals in its notes."""
    fit = _proposal(found, verdict)[1]
    if not fit.paths:
        return found.given
    notes = dict(fit.model.notes)
    for path in fit.paths:
        value, error = _known(found, fit, path)
        known = bool(np.isfinite(error))
        notes[path] = Note(
            f"fitted to {len(found.named)} trials by pma_gym.discovery",
            value - 1.96 * error if known else None,
            value + 1.96 * error if known else None,
        )
    for path in found.selection.undetermined if verdict in ("effect", "unknown") else ():
        notes[path] = Note("not determined by the trials: held where its law is at a limit")
    return replace(
        fit.model,
        name=f"{found.given.name}_amended",
        title=f"{found.given.title}; amended by a diagnosis",
        notes=notes,
    )


def _following(found: Findings, verdict: Verdict, blind: Sequence[str]):  # noqa: ANN202
    """What to measure next: what tells the survivors apart, or shows what could not be seen."""
    bench, selection = found.selection.bench, found.selection
    for place, rivals in enumerate(found.rivals):
        equal = [rival for rival in rivals if rival.equal][:3]
        if equal:
            others = [
                (
                    rival.fit,
                    tuple(
                        rival.suspect if i == place else suspect
                        for i, suspect in enumerate(selection.chosen)
                    ),
                )
                for rival in equal
            ]
            return next_experiment(bench, [(selection.fit, selection.chosen), *others], found.seed)
    if verdict == "undecidable" and selection.chosen:
        # Not borne out by trials left out: is it there, or nothing? Both beside the same noise.
        plain = bench.fit(found.refitted.model) or found.refitted
        pair = [(selection.fit, selection.chosen), (plain, ())]
        following = next_experiment(bench, pair, found.seed)
        if following is not None:
            return following
    silent = verdict in ("parameters", "agrees") and len(blind) > SILENT * len(found.suspects)
    if (verdict == "undecidable" or silent) and found.looks:
        worth = [look.suspect for look in (found.looks[:3] if suspicious(found) else found.looks)]
        return for_blind(found.bench, found.refitted, worth, found.looks)
    return None


def _worsened(
    found: Findings, verdict: Verdict, records: Sequence[TrialRecord]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What the proposed model fits worse than the given one; nothing where none is proposed."""
    if verdict not in ("effect", "parameters"):
        return (), ()
    levels = {
        BY_QUANTITY[name].name: found.adequacy.signals[name].floor
        for name in found.adequacy.signals
    }
    floors = {
        BY_QUANTITY[name].name: floor.level
        for name, floor in zip(OUTPUTS, found.floors, strict=True)
    }
    floors |= {signal: floor.level for signal, floor in levels.items() if floor is not None}
    return worsened(records, floors, found.seed)


def _doubts(found: Findings) -> list[str]:
    """Of named parameters, those that another could stand for, or that the trials hardly hold."""
    if found.fewest is None:
        return []
    named, free = found.fewest.fit.paths, found.selection.fit
    unsure = _not_identifiable(found, free)
    surely = [path for path, moved in _moved(found, free).items() if moved.significant]
    return [
        doubt(path, free, found.bench.own)
        for path in named
        if path in unsure or (path not in surely and twin(path, free) not in (None, *named))
    ]


def _warnings(found: Findings) -> tuple[str, ...]:
    words = [*_doubts(found), *widened_ranges(found.bench, found.proposed[1])]
    if found.discarded is not None:
        given, refitted = found.discarded
        words.append(
            f"a refit was discarded: it raises the whitened sum of squares of the readings that it "
            f"was fitted to, from {given:.5g} to {refitted:.5g}"
        )
    if not found.proposed[1].converged:
        words.append("the last fit stopped before it had converged; its intervals are rough")
    if found.unseen is None:
        words.append(
            "with one trial nothing can be left out: the gap after the amendment is that of the "
            "data it was fitted to"
        )
    return tuple(words)
