"""What a lab has stated to be good enough: structure below a tolerance is not called missing.

A tolerance is what a signal is judged by where there are neither repeats nor rest. Where the model
without effects keeps to it, and no effect of the catalogue carries what is left (a drift of a
sensor, say, which nothing but repeats tells from structure), the verdict is as if nothing had
passed the gate: the model agrees, or its parameters are off, within the tolerance.
"""

from dataclasses import replace

from pma_gym.discovery.screening.residuals import reestimated_noise
from pma_gym.discovery.thresholds import MOST_TOLERANCES
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.residual_fraction import residual_fraction
from pma_gym.discovery.verdict.unknown import leaves_structure, shapeless_laws, why_unknown


def may_be_tolerated(findings: Findings) -> bool:
    """Whether every signal has a tolerance, and what speaks against the model carries no name."""
    signals = findings.adequacy.signals.values()
    floors = [signal.floor for signal in signals]
    if not floors or any(floor is None or floor.source != "tolerance" for floor in floors):
        return False
    if not findings.selection.stages:
        return False
    left = residual_fraction(findings)
    unknown = why_unknown(findings, left, shapeless_laws(findings, left))
    return (unknown or leaves_structure(findings, left)) is not None


def without_effects(findings: Findings) -> Findings:
    """As if nothing had passed the gate; what is to be judged anew."""
    selection, refitted = findings.selection, findings.selection.refitted
    quiet = tuple(replace(stage, gate=(), missing=False) for stage in selection.stages[:1])
    noise = reestimated_noise(findings.problem, refitted, ())
    bare = replace(
        selection,
        stages=quiet,
        chosen=(),
        fit=refitted,
        problem=replace(findings.problem, noise=noise),
        undetermined={},
    )
    return replace(findings, selection=bare, refitted=refitted, elimination=None)


def is_tolerated(findings: Findings) -> bool:
    """Whether a model without effects keeps to the tolerances of all signals."""
    signals = findings.adequacy.signals.values()
    return all(signal.fault is None and signal.misfit <= MOST_TOLERANCES for signal in signals)
