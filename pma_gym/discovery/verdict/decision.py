"""The verdict: which of the five a diagnosis comes to."""

from collections.abc import Sequence

import numpy as np

from pma_gym.discovery.diagnosis import Verdict
from pma_gym.discovery.fitting.free_parameters import values
from pma_gym.discovery.selection.forward_selection import LEAST_CHANGE
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.unknown import Reason, gate

MOST_RIVALS = 2
"""Most others that an effect may be confused with and still be named: groups of three."""

MUCH_EXPLAINED = 0.1
"""Share of chi-square that an effect could explain, from which on its not passing the gate means
that there are too few data, not that the structure is right."""

BLIND_SHARE = 0.35
"""Share of the catalogue that would not have shown, from which on silence says nothing."""

MOVED_CHANGE = 0.1
"""Least rms change of the signals, over the noise, by which refitted parameters differ from those
that were given: below, they agree."""


def suspicious(found: Findings) -> bool:
    """Whether an effect could explain much, in too few data to rule chance out."""
    if gate(found) or not found.looks:
        return False
    best = found.looks[0]
    return best.change >= LEAST_CHANGE and best.gain > MUCH_EXPLAINED * found.refitted.chi_square


def verdict_of(
    found: Findings, unknown: Reason | None, blind: Sequence[str], coarse: bool, moved: bool
) -> Verdict:
    """The verdict.

    Args:
        found: what the steps found.
        unknown: why something is missing that no effect carries; None where that is not so.
        blind: effects that would not have shown.
        coarse: whether a sensor keeps to coarse steps.
        moved: whether a parameter moved beyond its error.
    """
    if unknown is not None:
        return "unknown"
    chosen = found.selection.chosen
    if gate(found) and not chosen:
        return "undecidable"
    if chosen:
        undecided = any(
            sum(rival.equal for rival in rivals) > MOST_RIVALS for rivals in found.rivals
        )
        return "undecidable" if undecided or not _confirmed(found) else "effect"
    if coarse:
        return "effect"
    if suspicious(found):
        return "undecidable"
    if found.searched and len(blind) > BLIND_SHARE * max(len(found.suspects), 1):
        return "undecidable"
    if found.adequacy.undecided is not None:
        return "undecidable"
    return "parameters" if moved and _change(found) > MOVED_CHANGE else "agrees"


def _confirmed(found: Findings) -> bool:
    """Whether the effects help on trials that the fits had not seen."""
    if found.unseen is None or found.unseen_without is None:
        return True
    with_it, without = found.unseen.surprise, found.unseen_without.surprise
    # By the number of folds too: one beyond what the others reach may weigh more than all.
    return bool(with_it.sum() < without.sum() or np.mean(with_it < without) > 0.5)


def _change(found: Findings) -> float:
    """Rms change of the signals by refitted parameters, over the noise, where that is most."""
    evidence = found.bench.evidence(found.given)
    both = np.stack([values(found.given, found.bench.own.free), found.refitted.values])
    columns = evidence.columns(both)
    if columns is None:
        return np.inf
    squares = sum(np.sum(part[1].astype(float) ** 2, axis=1) for part in columns)
    counts = sum(np.array(logged.measures) * float(len(logged.time)) for logged in evidence.logged)
    return float(np.sqrt(np.max(squares / np.maximum(counts, 1.0))))
