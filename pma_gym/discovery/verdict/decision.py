"""The verdict: which of the five a diagnosis comes to."""

from collections.abc import Iterable, Sequence

import numpy as np

from pma_gym.discovery.diagnosis import Verdict
from pma_gym.discovery.fitting.free_parameters import values
from pma_gym.discovery.thresholds import (
    LEAST_CHANGE,
    MAJORITY,
    MOST_RIVALS,
    MUCH_EXPLAINED,
    SLIGHT,
    UNDETECTABLE_SHARE,
)
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.unknown import Reason, gate


def suspicious(findings: Findings) -> bool:
    """Whether an effect could explain much, in too few data to rule chance out."""
    if gate(findings) or not findings.scores:
        return False
    best = findings.scores[0]
    return best.change >= LEAST_CHANGE and best.gain > MUCH_EXPLAINED * findings.refitted.chi_square


def is_ambiguous(name: str, rivals: Iterable[str]) -> bool:
    """Whether so many effects explain the data as well as one that none is named.

    The delay and the lag of one channel, a drive or a sensor, are one phenomenon. They differ by
    the square of the time only, and both say which channel is late and by how much.

    >>> is_ambiguous("encoder_delay", ["encoder_lag", "drive_delay", "drive_lag"])
    False
    """
    return len({_phenomenon(each) for each in rivals} - {_phenomenon(name)}) > MOST_RIVALS


def _phenomenon(name: str) -> str:
    return name.removesuffix("_delay").removesuffix("_lag")


def verdict_of(
    findings: Findings,
    unknown: Reason | None,
    not_detectable: Sequence[str],
    coarse: bool,
    moved: bool,
) -> Verdict:
    """The verdict.

    Args:
        findings: what the steps found.
        unknown: why something is missing that no effect carries; None where that is not so.
        not_detectable: effects that would not have shown.
        coarse: whether a sensor keeps to coarse steps.
        moved: whether a parameter moved beyond its error.
    """
    if unknown is not None:
        return "unknown"
    chosen = findings.selection.chosen
    if gate(findings) and not chosen:
        return "undecidable"
    if chosen:
        undecided = any(
            is_ambiguous(one.name, [rival.candidate.name for rival in rivals if rival.equal])
            for one, rivals in zip(chosen, findings.rivals, strict=False)
        )
        return "undecidable" if undecided or not _confirmed(findings) else "effect"
    if coarse:
        return "effect"
    if suspicious(findings):
        return "undecidable"
    if findings.searched and len(not_detectable) > UNDETECTABLE_SHARE * max(
        len(findings.candidates), 1
    ):
        return "undecidable"
    if findings.adequacy.undecided is not None:
        return "undecidable"
    return "parameters" if moved and _change(findings) > SLIGHT else "agrees"


def _confirmed(findings: Findings) -> bool:
    """Whether the effects help on trials that the fits had not seen."""
    if findings.unseen is None or findings.unseen_without is None:
        return True
    with_it, without = findings.unseen.deviance, findings.unseen_without.deviance
    # By the number of folds too: one beyond what the others reach may weigh more than all.
    return bool(with_it.sum() < without.sum() or np.mean(with_it < without) > MAJORITY)


def _change(findings: Findings) -> float:
    """Rms change of the signals by refitted parameters, over the noise, where that is most."""
    whitened = findings.problem.whitened_residuals(findings.given)
    both = np.stack([values(findings.given, findings.problem.own.free), findings.refitted.values])
    columns = whitened.columns(both)
    if columns is None:
        return np.inf
    squares = sum(np.sum(part[1].astype(float) ** 2, axis=1) for part in columns)
    counts = sum(np.array(logged.measures) * float(len(logged.time)) for logged in whitened.logged)
    return float(np.sqrt(np.max(squares / np.maximum(counts, 1.0))))
