"""Which experiment to propose: one that tells survivors apart, or shows what could not be seen."""

from collections.abc import Sequence

from pma_gym.discovery.diagnosis import Verdict
from pma_gym.discovery.experiments.detectability import experiment_to_detect
from pma_gym.discovery.experiments.next_experiment import next_experiment
from pma_gym.discovery.result.next_experiment import NextExperiment
from pma_gym.discovery.verdict.decision import suspicious
from pma_gym.discovery.verdict.findings import Findings

SILENT = 0.2
"""Share of the catalogue that would not have shown, from which on an experiment that would show it
is proposed although nothing seems to be missing."""


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
