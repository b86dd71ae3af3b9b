"""The verdict: which of the five a diagnosis comes to."""

from collections.abc import Sequence

import numpy as np

from pma_gym.discovery.constancy import spreads
from pma_gym.discovery.diagnosis import Verdict
from pma_gym.discovery.findings import Findings
from pma_gym.discovery.parameters import values
from pma_gym.discovery.residual_laws import Drawn, drawn_laws
from pma_gym.discovery.selection import LEAST_CHANGE
from pma_gym.discovery.slowness import Left

MOST_LEFT = 0.35
"""Share of what was slow in the residual that may be left by effects that explain it."""

DOUBTFUL = 0.08
"""The same, from which on laws without a shape of their own are set against the effects."""

BETTER, BETTER_BY = 1.15, 60.0
"""By how much such a law must explain more than the effects to say that they are not it: a factor
on their gain in chi-square, and chi-square."""

WORTH_DRAWING = 0.15
"""Share of the chi-square beyond noise that such a law must explain to be drawn."""

MOST_REMEMBERED = 0.1
"""Most of what the residual remembered of itself that it may still remember, beyond chance."""

MOST_SPREAD = 0.12
"""Most that an effect's size may scatter by trial or condition, beyond chance, as a share of it."""

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


def _gate(found: Findings) -> bool:
    """Whether anything passed the gate."""
    return bool(found.selection.stages and found.selection.stages[0].gate)


def _missing(found: Findings) -> bool:
    """Whether the residual says of itself that something is missing."""
    return bool(found.selection.stages and found.selection.stages[0].missing)


def shapeless_laws(found: Findings, left: Left) -> list[Drawn]:
    """Laws without a shape of their own, where the effects leave room for one."""
    if not (_gate(found) or _missing(found)):
        return []
    if left.most < DOUBTFUL and not _scatters(found):
        return []
    return drawn_laws(found.selection.bench, found.refitted)


def _scatters(found: Findings) -> bool:
    """Whether an effect that was selected is of another size by trial or by condition."""
    selection = found.selection
    return any(
        scatter > MOST_SPREAD
        for place in range(len(selection.chosen))
        for scatter in spreads(selection.bench, selection.fit, selection.chosen, place).values()
    )


def _outdone(found: Findings, laws: Sequence[Drawn]) -> bool:
    """Whether a law without a shape of its own explains more than the effects do."""
    if not laws:
        return False
    selection = found.selection
    evidence = selection.bench.evidence(found.refitted.model)
    before = evidence.sums(found.refitted.values, np.empty(0)).chi_square
    gain = before - selection.fit.chi_square
    return laws[0].gain > max(BETTER * gain, gain + BETTER_BY)


def telling(found: Findings, laws: Sequence[Drawn]) -> bool:
    """Whether the best law without a shape of its own explains enough to be drawn."""
    if not laws:
        return False
    evidence = found.selection.bench.evidence(found.refitted.model)
    count = sum(logged.count for logged in evidence.logged)
    before = evidence.sums(found.refitted.values, np.empty(0)).chi_square
    return laws[0].gain > max(BETTER_BY, WORTH_DRAWING * (before - count))


def suspicious(found: Findings) -> bool:
    """Whether an effect could explain much, in too few data to rule chance out."""
    if _gate(found) or not found.looks:
        return False
    best = found.looks[0]
    return best.change >= LEAST_CHANGE and best.gain > MUCH_EXPLAINED * found.refitted.chi_square


def verdict_of(
    found: Findings,
    left: Left,
    laws: Sequence[Drawn],
    blind: Sequence[str],
    coarse: bool,
    moved: bool,
) -> Verdict:
    """The verdict.

    Args:
        found: what the steps found.
        left: what the effects leave of the residual.
        laws: laws without a shape of their own, the one that explains most first.
        blind: effects that would not have shown.
        coarse: whether a sensor keeps to coarse steps.
        moved: whether a parameter moved beyond its error.
    """
    chosen = found.selection.chosen
    gate = _gate(found)
    remains = left.slow > MOST_LEFT or left.remembered > MOST_REMEMBERED
    if gate and (remains or _scatters(found) or _outdone(found, laws)):
        return "unknown"
    if not chosen and _missing(found):
        return "unknown"
    if gate and not chosen:
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
