"""The model that a diagnosis proposes, and the fit that it comes from."""

from dataclasses import replace

import numpy as np

from pma_gym.discovery.answer.estimates import value_and_error
from pma_gym.discovery.diagnosis import Verdict
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.selection.backward_elimination import as_given
from pma_gym.discovery.verdict.findings import Findings
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
            value - 1.96 * error if known else None,
            value + 1.96 * error if known else None,
        )
    for path in findings.selection.undetermined if verdict in ("effect", "unknown") else ():
        notes[path] = Note("not determined by the trials: held where its law is at a limit")
    return replace(
        fit.model,
        name=f"{findings.given.name}amended_model",
        title=f"{findings.given.title}; amended by a diagnosis",
        notes=notes,
    )
