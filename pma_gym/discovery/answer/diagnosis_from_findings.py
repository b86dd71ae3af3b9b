"""Everything that a diagnosis says, from what its steps found.

The model that it proposes, the fit that it comes from, and which experiment to do: one that tells
survivors apart, or shows what could not be seen.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.answer.candidate_list import candidate_list
from pma_gym.discovery.answer.estimates import (
    covariance_of,
    rival_models,
    selected_effects,
    value_and_error,
)
from pma_gym.discovery.answer.own_parameters import (
    moved_parameters,
    not_identifiable,
    parameters_off,
)
from pma_gym.discovery.answer.reader_warnings import approximate_law_warnings, reader_warnings
from pma_gym.discovery.answer.trial_records import (
    floors_in_file_units,
    gaps,
    judgements,
    trial_records,
)
from pma_gym.discovery.diagnosis import Diagnosis, Verdict
from pma_gym.discovery.experiments.detectability import experiment_to_detect
from pma_gym.discovery.experiments.next_experiment import next_experiment
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.trial_states import misfits, trial_states
from pma_gym.discovery.preparation.quantisation import coarse_sensors
from pma_gym.discovery.report.noise_text import nuisances
from pma_gym.discovery.report.verdict_text import sentence, steps
from pma_gym.discovery.result.estimates import Approximate, Moved, NamedEffect
from pma_gym.discovery.result.misfit import ResidualLaw, TrialRecord
from pma_gym.discovery.result.next_experiment import NextExperiment
from pma_gym.discovery.screening.localisation import localise
from pma_gym.discovery.screening.residuals import residuals
from pma_gym.discovery.selection.backward_elimination import as_given
from pma_gym.discovery.thresholds import APPROXIMATE_SCATTER, CONFIDENCE, UNDETECTABLE_WORTH
from pma_gym.discovery.verdict.approximate import closing
from pma_gym.discovery.verdict.decision import suspicious, verdict_of
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.residual_fraction import ResidualFraction, residual_fraction, tones
from pma_gym.discovery.verdict.residual_laws import residual_law
from pma_gym.discovery.verdict.unknown import (
    Reason,
    leaves_structure,
    shapeless_laws,
    telling,
    why_unknown,
    widest_scatter,
)
from pma_gym.discovery.verdict.worsened import worsened
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model
from pma_gym.plant.parameter_rows import Note


def proposal(
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


def amended_model(findings: Findings, verdict: Verdict) -> Model:
    """The model with what was found, its intervals in its notes."""
    fit = proposal(findings, verdict)[1]
    if not fit.paths:
        return findings.given
    notes = dict(fit.model.notes)
    for path in fit.paths:
        value, error = value_and_error(findings, fit, path)
        known = bool(np.isfinite(error))
        notes[path] = Note(
            f"fitted to {len(findings.named)} trials by pma_gym.discovery",
            value - CONFIDENCE * error if known else None,
            value + CONFIDENCE * error if known else None,
        )
    for path in findings.selection.undetermined if verdict in ("effect", "unknown") else ():
        notes[path] = Note("not determined by the trials: held where its law is at a limit")
    return replace(
        fit.model,
        name=f"{findings.given.name}_amended",
        title=f"{findings.given.title}; amended by a diagnosis",
        notes=notes,
    )


def proposed_experiment(
    findings: Findings, verdict: Verdict, not_detectable: Sequence[str]
) -> NextExperiment | None:
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
    silent = verdict in ("parameters", "agrees") and len(not_detectable) > UNDETECTABLE_WORTH * len(
        findings.candidates
    )
    if (verdict == "undecidable" or silent) and findings.scores:
        worth = [
            score.candidate
            for score in (findings.scores[:3] if suspicious(findings) else findings.scores)
        ]
        return experiment_to_detect(findings.problem, findings.refitted, worth, findings.scores)
    return None


Progress = Callable[[str, int, int], None]


def diagnosis_from_findings(findings: Findings, tell: Progress, propose: bool = True) -> Diagnosis:
    """The diagnosis, with the next experiment if one is to be proposed."""
    tell("putting the answer together", 0, 3)
    left = residual_fraction(findings)
    decision = _decision(findings, left)
    verdict, unknown = decision.verdict, decision.unknown
    model = amended_model(findings, verdict)
    tell("putting the answer together", 1, 3)
    where, maps = localise(
        findings.problem.whitened_residuals(findings.refitted.model),
        findings.refitted,
        np.array([floor.level for floor in findings.floors]),
        findings.seed,
    )
    problem, fit, chosen = proposal(findings, verdict)
    states = trial_states(problem, fit, chosen, [each.name for each in findings.named])
    tell("putting the answer together", 2, 3)
    hidden = decision.not_detectable
    diagnosis = Diagnosis(
        verdict=verdict,
        sentence="",
        where=where,
        effects=decision.effects,
        parameters=decision.parameters,
        gap=gaps(decision.records),
        candidates=candidate_list(findings),
        next_experiment=proposed_experiment(findings, verdict, hidden) if propose else None,
        model=model,
        given=findings.given,
        # Where nothing is amended, how sure the model's own parameters are.
        covariance=covariance_of(findings, fit if fit.paths else findings.refitted),
        rivals=rival_models(findings, model) if verdict in ("effect", "undecidable") else (),
        not_identifiable={
            path: why
            for path, why in not_identifiable(findings, findings.selection.fit).items()
            if path not in decision.parameters
        },
        not_detectable=hidden,
        approximate=decision.approximate,
        law=decision.law,
        tones=tones(findings) if verdict == "unknown" else {},
        floors=floors_in_file_units(findings),
        nuisances=nuisances(findings),
        adequacy=judgements(findings),
        trials=decision.records,
        states=states,
        written=misfits(findings.named, model, states),
        maps=maps,
        warnings=(*reader_warnings(findings), *approximate_law_warnings(verdict, unknown)),
        converged=findings.proposed[1].converged,
        worsened=_worsened(findings, verdict, decision.records),
    )
    reason = unknown if verdict == "unknown" else None
    return replace(
        diagnosis, sentence=sentence(diagnosis, reason), steps=steps(findings, diagnosis, left)
    )


@dataclass(frozen=True)
class _Decision:
    """The verdict and what it rests on.

    Attributes:
        verdict: the verdict.
        unknown: why structure is missing that no effect of the catalogue carries; None: none is.
        effects: what is missing; empty unless the verdict is `effect`.
        parameters: the model's own that moved.
        not_detectable: effects that would not have shown at their usual size.
        approximate: effects whose law is only approximate.
        law: the residual law.
        records: curves and gaps of each trial.
    """

    verdict: Verdict
    unknown: Reason | None
    effects: tuple[NamedEffect, ...]
    parameters: Mapping[str, Moved]
    not_detectable: tuple[str, ...]
    approximate: Approximate | None
    law: ResidualLaw | None
    records: tuple[TrialRecord, ...]


def _decision(findings: Findings, left: ResidualFraction) -> _Decision:
    """Decide the verdict; `left` is what the proposed model leaves of what is slow."""
    coarse = coarse_sensors(findings.floors, _misfits(findings))
    laws = shapeless_laws(findings, left)
    through = findings.given.rig.modifying_ports
    not_detectable = tuple(
        score.candidate.name
        for score in findings.scores
        # What only changes another effect shows with that one alone.
        if (score.resolvable is None or score.resolvable > 1.0)
        and CATALOGUE[score.candidate.effect].port not in through
    )
    parameters = (
        moved_parameters(findings, findings.selection.fit)
        if findings.elimination is None
        else parameters_off(findings, findings.elimination.fit)
    )
    off = any(moved.significant for moved in parameters.values())
    records = trial_records(findings)
    unknown = why_unknown(findings, left, laws) or leaves_structure(findings, left)
    verdict = verdict_of(findings, unknown, not_detectable, bool(coarse), off)
    chosen = tuple(candidate.name for candidate in findings.selection.chosen)
    is_right = unknown is None and findings.adequacy.structure is None
    closes = None if is_right or not chosen else closing(gaps(records), chosen)
    final = unknown is not None and unknown.final
    if (
        closes is not None
        and closes.named
        and not final
        and widest_scatter(findings) <= APPROXIMATE_SCATTER
    ):
        # An approximate law is a name where a right one would be; else the verdict stays.
        named = verdict_of(findings, None, not_detectable, bool(coarse), off)
        verdict = named if named == "effect" else verdict
    approximate = None
    if closes is not None and closes.worth_saying:
        approximate = Approximate(selected_effects(findings), closes.left, closes.held_out)
    return _Decision(
        verdict,
        unknown,
        (*selected_effects(findings), *coarse) if verdict == "effect" else (),
        parameters,
        not_detectable,
        approximate,
        residual_law(laws[0]) if unknown is not None and telling(findings, laws) else None,
        records,
    )


def _misfits(findings: Findings) -> list[float]:
    """What the refitted model leaves of each output (root mean square, SI), NaN if not measured."""
    left = residuals(
        findings.problem.whitened_residuals(findings.refitted.model), findings.refitted
    )
    joined = [np.concatenate([part[channel] for part in left]) for channel in range(len(left[0]))]
    known = [values[np.isfinite(values)] for values in joined]
    return [float(np.sqrt(np.mean(each**2))) if each.size else np.nan for each in known]


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
